"""Options of the filters: help and range of fields of their classes, and of ``build``."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypedDict

from jax.typing import ArrayLike

from jaxpf.contract.numbers import MOST
from jaxpf.contract.options import Option
from jaxpf.gradients import MOTION_GRADIENTS
from jaxpf.resampling.schemes import SCHEMES

Order = Annotated[
    tuple[int, ...] | None,
    Option(
        "Order of the objects for ps, counted from 1, such as 3,1,2.",
        least=0,
        places=True,
        needs=("method", "ps"),
        rare=True,
    ),
]
Swap = Annotated[
    Literal["none", "random", "sorted", "combinatorial"],
    Option(
        "How sps exchanges parts between particles: combinatorial (unbiased), sorted (as published "
        "in 2011; biased), random or none.",
        needs=("method", "sps"),
        rare=True,
    ),
]
NumParticles = Annotated[
    int,
    Option(
        "Number of particles; of eskil and pffl, of each object.",
        least=1,
        most=MOST,
        flags=("-n",),
        compiles=True,
    ),
]
Resampling = Annotated[Any, Option("Resampling scheme.", choices=SCHEMES, compiles=True, rare=True)]
EssThreshold = Annotated[
    Any,
    Option(
        "Resample only if the effective sample size is at most this share of the particles; by "
        "default always.",
        kind=float,
        least=0,
        most=1,
        rare=True,
    ),
]
JointWeighting = Annotated[
    bool,
    Option(
        "Weight each object by the joint likelihood, with the others as predicted; for objects "
        "that exclude one another, such as contours.",
        compiles=True,
        rare=True,
    ),
]
Upsampling = Annotated[
    int, Option("Moves per particle.", least=1, most=1000, compiles=True, rare=True)
]
Drift = Annotated[
    Literal["clip", "signed", "literal", "ridge", "none"],
    Option("How objects move together (eskil only).", compiles=True, rare=True),
]
Shape = Annotated[
    Literal["relative", "pixels", "none"],
    Option("How objects keep their distances (eskil only).", compiles=True, rare=True),
]
ShapeScale = Annotated[
    Any,
    Option(
        "Tolerated stretch of distances between objects: a share, or pixels (eskil only).",
        kind=float,
        above=0,
        path="shape_scale",
        rare=True,
    ),
]
VelocityMemory = Annotated[
    int,
    Option(
        "Frames over which velocities are compared (eskil only).",
        least=2,
        most=1000,
        compiles=True,
        rare=True,
    ),
]
Proper = Annotated[
    bool,
    Option(
        "The drift is a proposal instead of part of the dynamics (eskil only).",
        compiles=True,
        rare=True,
    ),
]
Form = Annotated[
    Literal["auxiliary", "literal"],
    Option(
        "How pffl weights: as a properly weighted auxiliary particle filter, or literally as "
        "published.",
        compiles=True,
        rare=True,
    ),
]
Weights = Annotated[
    Literal["equal_share", "plain", "corrected"],
    Option(
        "How labelled particles are shared: equal_share (the same number for each object, as "
        "published; biases the evidence), plain (in proportion to their likelihoods), corrected "
        "(equal shares, weights kept).",
        compiles=True,
        rare=True,
    ),
]
Feedback = Annotated[
    Literal["none", "estimate"],
    Option(
        "Whether labelled particles move at their own speed (none) or at that of the estimate.",
        compiles=True,
        rare=True,
    ),
]
Regularise = Annotated[
    tuple[float, float] | None,
    Option(
        "Rates of position and speed in the regularised estimates of labelled particles, such as "
        "0.9,0.5; by default they are not regularised.",
        above=0,
        most=1,
        path="regularise",
        rare=True,
    ),
]
#: Fields of classes alone.
Share = Annotated[ArrayLike, Option("A share.", above=0, most=1)]
MaybeShare = Annotated[ArrayLike | None, Option("A share, or several.", above=0, most=1)]
MotionGradient = Annotated[str, Option("The motion's gradient.", choices=MOTION_GRADIENTS)]
Population = Annotated[
    Literal["fixed", "open"], Option("Whether targets may come and go between frames.")
]


class FilterOptions(TypedDict, total=False):
    """The options of this library's filters, for signatures of factories."""

    order: Sequence[int] | None
    swap: Swap
    resampling: Resampling
    ess_threshold: EssThreshold
    joint_weighting: JointWeighting
    upsampling: Upsampling | None
    drift: Drift
    shape: Shape
    shape_scale: ShapeScale
    velocity_memory: VelocityMemory
    proper: Proper
    form: Form
    weights: Weights
    feedback: Feedback
    regularise: Sequence[float] | None
