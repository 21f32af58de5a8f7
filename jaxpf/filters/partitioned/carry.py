"""Data that the stages of a frame share, draw, and carry from one to the next."""

from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.logs import add_exactly, counted, finite
from jaxpf.contract.state import ParticleState
from jaxpf.filters.partitioned.exchange import Groups, Offer
from jaxpf.filters.partitioned.settings import Settings
from jaxpf.lowering.columns import pick_in_rows
from jaxpf.resampling.components import Components, component_max


class Shared(NamedTuple):
    """Data common to all stages of a frame.

    Attributes:
        tracker: the model and the settings.
        state: the weighted set of the previous frame.
        observation: from the likelihood's ``observe``.
        components: the division of the particles into components in this frame.
        motion: the strategy that draws substates.
    """

    tracker: Settings
    state: ParticleState
    observation: Any
    components: Components
    motion: "Draws"


class Draws(Protocol):
    """What draws a stage's substates, see ``jaxpf.filters.partitioned.motion``."""

    def draw(self, shared: Shared, key: jax.Array, turn: "Turn") -> "Drawn":
        """Draw one substate for every particle."""


class Keys(NamedTuple):
    """Random keys of a stage, one per operation."""

    move: jax.Array
    select: jax.Array
    exchange: jax.Array
    weigh: jax.Array


class Turn(NamedTuple):
    """Conditions for a stage's draws.

    Attributes:
        partition: ``[N]`` int32, the partition that each particle processes.
        source: ``[N]`` int32, its index among the P * N substates of the previous frame.
        conditions: three arrays ``[D, N]``: the substates of the two previous frames, and the
            parent's substate of this frame.
        others: for coupled dynamics, all substates of the previous frame, ``[P, D, N]``; else
            empty.
    """

    partition: jax.Array
    source: jax.Array
    conditions: tuple[jax.Array, jax.Array, jax.Array]
    others: tuple[jax.Array, ...] = ()


class Drawn(NamedTuple):
    """A stage's draws; ``partition``, ``source`` and ``conditions`` as in ``Turn``.

    Attributes:
        substates: ``[D, N]``.
        log_weight: ``[N]``, log of the transition density over the sampled density; None if these
            are the same.
        score: ``[N]``, adds its derivative to the weights, but not its value; or None.
    """

    partition: jax.Array
    source: jax.Array
    conditions: tuple[jax.Array, jax.Array, jax.Array]
    substates: jax.Array
    log_weight: jax.Array | None = None
    score: jax.Array | None = None


class Carry(NamedTuple):
    """State carried between the stages of a frame.  Rows are stages, not partitions.

    Attributes:
        stages: ``[2, D, P, N]``, substates drawn at each stage, and their predecessors.
        log_probs: ``[P, N]``, log-likelihood of each draw, indexed by the slot that drew it.
        lineage: ``[P, N]`` int32, see ``jaxpf.filters.partitioned.kernel``.
        log_weights: ``[N]``, unnormalised: their sum and ``taken`` carry the evidence.
        taken: ``[2, C]``, log of the factors taken out of each component's weights, see
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
    taken: jax.Array
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

    def take_out(
        self, log_factor: jax.Array, components: Components
    ) -> tuple[jax.Array, jax.Array]:
        """Divide a factor ``[N]`` by its largest value in each component, ``[C]``; return both."""
        largest = finite(component_max(counted(log_factor, self.log_weights), components))
        return log_factor - components.spread(largest), largest

    def absorb(
        self,
        log_factor: jax.Array,
        taken: jax.Array,
        components: Components,
        stage: jax.Array | None = None,
    ) -> "Carry":
        """Multiply the weights by a factor, unless it is zero for a whole component.

        A component whose factors are all zero is marked impossible and keeps its weights.  If all
        components end up impossible, the frame is skipped and the weights survive.  ``taken``,
        ``[C]``, is what has been taken out of the factor.
        """
        if self.path_scores is not None:
            log_factor = lax.stop_gradient(log_factor)  # the scores hold its derivative
        log_weights = self.log_weights + log_factor
        largest = component_max(log_weights, components)
        seen = ~jnp.isneginf(largest)
        carry = self if stage is None else self.write(stage, seen=seen)
        return carry._replace(
            log_weights=jnp.where(components.spread(seen), log_weights, self.log_weights),
            taken=add_exactly(self.taken, jnp.where(seen, taken, 0.0)),
            largest=jnp.where(seen, largest, self.largest),
            impossible=self.impossible | ~seen,
        )
