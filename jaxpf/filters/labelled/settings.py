"""The settings of the labelled filter, which all of its files read."""

from collections.abc import Sequence
from typing import Any

from jax.typing import ArrayLike

from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.contract.types import DynamicsLike, LikelihoodLike
from jaxpf.filters import options as of
from jaxpf.gradients import Gradient, NoGradient


@pytree_dataclass
class Settings:
    """The fields of ``jaxpf.Labelled``, which documents them."""

    dynamics: DynamicsLike
    likelihood: LikelihoodLike
    initial: Any
    regularise: ArrayLike | None = None
    resampling: Any = "systematic"
    gradient: Gradient = NoGradient()
    num_targets: Any = static_field(default=None)
    num_particles: of.NumParticles = static_field(default=300)
    weights: of.Weights = static_field(default="equal_share")
    feedback: of.Feedback = static_field(default="none")
    population: str = static_field(default="fixed")
    position: Sequence[int] = static_field(default=(0, 1))
    speed: Sequence[int] | None = static_field(default=None)
    motion_gradient: str = static_field(default="pathwise")
