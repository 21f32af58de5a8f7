"""The settings of the partitioned filter, which all of its files read."""

import dataclasses
from typing import Any

from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.contract.types import DynamicsLike, LikelihoodLike, ProposalLike
from jaxpf.filters import options as of
from jaxpf.gradients import Gradient, NoGradient
from jaxpf.ordering import Ordering


@pytree_dataclass
class Settings:
    """The fields of ``jaxpf.Partitioned``, which documents them."""

    dynamics: DynamicsLike
    likelihood: LikelihoodLike
    ordering: Ordering
    initial: Any
    initial_label: Any = None
    tempering: of.MaybeShare = None
    ess_threshold: of.EssThreshold = None
    proposal: ProposalLike | None = None
    resampling: Any = "systematic"
    gradient: Gradient = NoGradient()
    joint_weighting: bool = static_field(default=False)
    parents: Any = static_field(default=None)
    num_particles: of.NumParticles = static_field(default=300)
    keep_ancestors: bool = static_field(default=False)
    motion_gradient: of.MotionGradient = static_field(default="pathwise")
    refused: Any = dataclasses.field(default=None, init=False)

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return self.ordering.num_partitions
