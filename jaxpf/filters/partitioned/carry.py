"""Settings, data and draws that the stages of a frame share, and what one hands to the next."""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.calls import first_motion, optional
from jaxpf.contract.logs import add_exactly, counted, finite
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.contract.state import ParticleState
from jaxpf.contract.types import DynamicsLike, LikelihoodLike, ProposalLike
from jaxpf.filters import options as of
from jaxpf.filters.partitioned.exchange import Groups, Offer
from jaxpf.gradients import Gradient, NoGradient
from jaxpf.lowering.columns import pick_in_rows
from jaxpf.ordering import Ordering
from jaxpf.resampling.components import Components, component_max


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

    @property
    def moves_labels(self) -> bool:
        """Whether particles carry labels that change from frame to frame."""
        moves = optional(first_motion(self.dynamics), "propagate_label")
        return self.initial_label is not None and moves is not None

    @property
    def sees_previous(self) -> bool:
        """Whether the likelihood depends on the previous state, which a substate then holds too."""
        return False


class Shared(NamedTuple):
    """Data common to all stages of a frame.

    Attributes:
        tracker: the model and the settings.
        state: the weighted set of the previous frame.
        observation: from the likelihood's ``observe``.
        components: the division of the particles into components in this frame.
    """

    tracker: Settings
    state: ParticleState
    observation: Any
    components: Components


class Drawn(NamedTuple):
    """A stage's draws.

    Attributes:
        partition: ``[N]`` int32, the partition that each particle draws.
        source: ``[N]`` int32, its index among the P * N substates of the previous frame.
        previous: ``[D, N]``, the partition's substate in the previous frame.
        substates: ``[D, N]``.
        log_weight: ``[N]``, log of the transition density over the sampled density; None if these
            are the same.
        score: ``[N]``, adds its derivative to the weights, but not its value; or None.
    """

    partition: jax.Array
    source: jax.Array
    previous: jax.Array
    substates: jax.Array
    log_weight: jax.Array | None = None
    score: jax.Array | None = None


class Carry(NamedTuple):
    """State carried between the stages of a frame.  Rows are stages, not partitions.

    Attributes:
        stages: ``[2, D, P, N]``, substates drawn at each stage, and their predecessors.
        log_probs: ``[P, N]``, log-likelihood of each draw, indexed by the slot that drew it.
        lineage: ``[P, N]`` int32, see ``jaxpf.filters.partitioned.kernel``.
        log_weights: ``[N]``, unnormalised: their sum and ``log_scale`` carry the evidence.
        log_scale: ``[2, C]``, log of what each component's weights were divided by, see
            ``jaxpf.contract.logs.add_exactly``.
        seen: ``[P, C]`` bool, whether at that stage some particle of the component had nonzero
            weight and nonzero likelihood.
        largest: ``[C]``, the largest log-weight of each component.
        impossible: ``[C]`` bool, whether all likelihoods of the component were zero at some stage,
            which ``log_weights`` then skip; an empty component is impossible.
        equal: ``[]`` bool, whether weights were equal after the last resampling.
        num_invalid: ``[]`` int32, number of invalid log-likelihoods.
        label: ``[N]`` int32, each particle's label, or its component without labels.
        path_scores: ``[P, N]``, indexed by drawing slot, see ``ParticleState``; or None.
        sources: ``[P, N]`` int32, indexed by drawing slot, see ``ParticleState``; or None.
        selections: ``[]``, number in this frame, see ``ParticleState``; or None.
        offers: entries ``[P, N]``, offers of each part of the level for exchange; None if the
            ordering never exchanges.
        groups: entries ``[P, N]``, particles that share each stage's draw once its level has
            ended, for the combinatorial rule; None like ``offers``.
    """

    stages: jax.Array
    log_probs: jax.Array
    lineage: jax.Array
    log_weights: jax.Array
    log_scale: jax.Array
    seen: jax.Array
    largest: jax.Array
    impossible: jax.Array
    equal: jax.Array
    num_invalid: jax.Array
    label: jax.Array
    path_scores: jax.Array | None
    sources: jax.Array | None
    selections: jax.Array | None
    offers: Offer | None
    groups: Groups | None

    def lineage_of(self, particles: jax.Array) -> jax.Array:
        """Lineage ``[P, N]`` of the given particles, ``[N]`` or per row ``[P, N]``."""
        return pick_in_rows(self.lineage, particles)

    def write(self, stage: jax.Array, **rows: jax.Array) -> "Carry":
        """Replace a stage's row of the named entries."""
        is_only_row = self.lineage.shape[0] == 1

        def written(name: str, row: jax.Array) -> Any:
            axis = 2 if name == "stages" else 0
            if is_only_row:
                return jnp.expand_dims(row, axis)
            return lax.dynamic_update_index_in_dim(getattr(self, name), row, stage, axis)

        return self._replace(**{name: written(name, row) for name, row in rows.items()})

    def relative(
        self, log_factor: jax.Array, components: Components
    ) -> tuple[jax.Array, jax.Array]:
        """Divide a factor ``[N]`` by its largest value in each component, ``[C]``; return both."""
        largest = finite(component_max(counted(log_factor, self.log_weights), components))
        return log_factor - components.spread(largest), largest

    def multiplied(
        self,
        log_factor: jax.Array,
        log_scale: jax.Array,
        components: Components,
        stage: jax.Array | None = None,
    ) -> "Carry":
        """Multiply the weights by a factor, unless it is zero for a whole component.

        A component whose factors are all zero is marked impossible and keeps its weights.  If all
        components end up impossible, the frame is skipped and the weights survive.  ``log_scale``,
        ``[C]``, is the log of what the factor was divided by.
        """
        if self.path_scores is not None:
            log_factor = lax.stop_gradient(log_factor)  # the scores hold its derivative
        log_weights = self.log_weights + log_factor
        largest = component_max(log_weights, components)
        seen = ~jnp.isneginf(largest)
        carry = self if stage is None else self.write(stage, seen=seen)
        return carry._replace(
            log_weights=jnp.where(components.spread(seen), log_weights, self.log_weights),
            log_scale=add_exactly(self.log_scale, jnp.where(seen, log_scale, 0.0)),
            largest=jnp.where(seen, largest, self.largest),
            impossible=self.impossible | ~seen,
        )
