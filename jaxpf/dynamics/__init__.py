"""How a substate moves from frame to frame."""

from jaxpf.dynamics.gaussian import AR2, FirstOrder, IndependentGaussian, LinearGaussian, RandomWalk
from jaxpf.dynamics.learned import fit
from jaxpf.dynamics.occlusion import FLIP, WithOcclusion
from jaxpf.dynamics.relative import PixelMotion, RelativeMotion

__all__ = [
    "AR2",
    "FLIP",
    "FirstOrder",
    "IndependentGaussian",
    "LinearGaussian",
    "PixelMotion",
    "RandomWalk",
    "RelativeMotion",
    "WithOcclusion",
    "fit",
]
