from .gaussian import (
    AR2 as AR2,
    FirstOrder as FirstOrder,
    IndependentGaussian as IndependentGaussian,
    LinearGaussian as LinearGaussian,
    RandomWalk as RandomWalk,
)
from .joints import RelativeToParent as RelativeToParent, UniformAround as UniformAround
from .learned import fit as fit
from .occlusion import WithOcclusion as WithOcclusion
