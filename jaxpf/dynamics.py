"""How a substate moves from frame to frame."""

from jaxpf.models.dynamics import (
    AR2,
    FirstOrder,
    IndependentGaussian,
    LinearGaussian,
    RandomWalk,
)
from jaxpf.models.learned_dynamics import fit
from jaxpf.models.occlusion import FLIP, WithOcclusion
from jaxpf.models.relative_motion import PixelMotion, RelativeMotion

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
