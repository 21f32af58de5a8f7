from .gaussian import (
    AR2 as AR2,
    FirstOrder as FirstOrder,
    IndependentGaussian as IndependentGaussian,
    LinearGaussian as LinearGaussian,
    RandomWalk as RandomWalk,
)
from .joints import (
    RelativeToParent as RelativeToParent,
    UniformAround as UniformAround,
    UniformJoints as UniformJoints,
    joints_between as joints_between,
    place as place,
    substates_at as substates_at,
)
from .learned import fit as fit
from .occlusion import FLIP as FLIP, WithOcclusion as WithOcclusion
from .relative import PixelMotion as PixelMotion, RelativeMotion as RelativeMotion
