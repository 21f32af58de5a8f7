"""How a stage draws its substates: strategies that the kernel asks once a frame and once a stage.

``motion_of`` picks one from a tracker's settings.  A strategy whose draws do not follow the
transition density gives each draw the weight that makes up for it, ``Drawn.log_weight``.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.contract.state import ParticleState
from jaxpf.filters import relocation
from jaxpf.filters.partitioned.carry import Drawn, Shared
from jaxpf.lowering.branches import computed_once

if TYPE_CHECKING:
    from jaxpf.filters.partitioned.tracker import Partitioned


class Motion:
    """Draws from the dynamics, which need no weight."""

    def check(self, tracker: "Partitioned") -> None:
        """Refuse a tracker that the strategy does not work with."""

    def begin(
        self, tracker: "Partitioned", key: jax.Array, state: ParticleState, observation: Any
    ) -> "Motion":
        """The strategy for one frame, given the weighted set of the frame before."""
        return self

    def draw(
        self,
        shared: Shared,
        key: jax.Array,
        partition: jax.Array,
        source: jax.Array,
        conditions: tuple[jax.Array, jax.Array, jax.Array],
        others: tuple[jax.Array, ...],
    ) -> Drawn:
        """One substate for every particle; ``others`` are for coupled dynamics, else empty."""
        dynamics = shared.tracker.dynamics
        substates = _once(
            shared,
            lambda: contract.propagate_all(dynamics, key, partition, *conditions, *others).astype(
                conditions[0].dtype
            ),
            like=conditions[0],
        )
        return Drawn(partition, source, conditions, substates)


class Relocating(Motion):
    """Lets objects that are probably lost jump; see ``jaxpf.filters.relocation``.

    Attributes:
        jumps: of one frame.
    """

    def __init__(self, jumps: Any = None):
        self.jumps = jumps

    def check(self, tracker: "Partitioned") -> None:
        """See ``Motion``."""
        relocation.check_relocation(tracker)

    def begin(
        self, tracker: "Partitioned", key: jax.Array, state: ParticleState, observation: Any
    ) -> "Relocating":
        """See ``Motion``: draws the jumps of all partitions."""
        weights = jnp.exp(state.log_weights)
        estimate = jnp.where(weights > 0, state.lagged[0], 0.0) @ weights  # [D, P]
        # All at once: a generator of random numbers takes long to compile.
        shape = (tracker.num_partitions, 4, tracker.num_particles)
        uniform = jax.random.uniform(
            jax.random.fold_in(key, tracker.num_partitions + 1), shape, estimate.dtype
        )
        log_odds = jnp.asarray(state.log_odds)
        return Relocating(relocation.drawn(tracker, uniform, log_odds, estimate, observation))

    def draw(self, shared, key, partition, source, conditions, others) -> Drawn:
        """See ``Motion``."""
        drawn = super().draw(shared, key, partition, source, conditions, others)
        substates, left, log_weight = relocation.taken(
            self.jumps, partition, drawn.substates, conditions[0]
        )
        return drawn._replace(
            substates=substates, conditions=(left, *conditions[1:]), log_weight=log_weight
        )


class Proposed(Motion):
    """Draws from a ``jaxpf.contract.Proposal``, and from the dynamics what was not seen."""

    def __init__(self, proposal: Any):
        self.proposal = proposal

    def check(self, tracker: "Partitioned") -> None:
        """See ``Motion``."""
        dynamics = type(tracker.dynamics).__name__
        contract.check_uncoupled(tracker.dynamics, "a proposal")
        if not contract.has_log_density(tracker.dynamics):
            raise InputError(
                f"a proposal is weighed by the transition density, and {dynamics} has none; add "
                "the method log_density (see jaxpf.contract.DynamicsWithDensity) or leave out "
                "proposal."
            )
        contract.proposal_of(self.proposal, tracker.dynamics, tracker.likelihood)
        if tracker.relocation is not None:
            raise InputError(
                "proposal and relocation both replace the draw of the dynamics; leave out one."
            )

    def draw(self, shared, key, partition, source, conditions, others) -> Drawn:
        """See ``Motion``: the weight is the transition density over the proposal's."""
        dynamics, dtype = shared.tracker.dynamics, conditions[0].dtype
        likelihood, observation, seen = contract.as_seen(
            shared.tracker.likelihood, shared.observation
        )
        proposal = contract.proposal_of(self.proposal, dynamics, likelihood)

        def moved() -> tuple[jax.Array, jax.Array]:
            substates = contract.propagate_all(dynamics, key, partition, *conditions)
            return substates.astype(dtype), jnp.zeros(partition.shape, dtype)

        def proposed() -> tuple[jax.Array, jax.Array]:
            substates = contract.propose_all(
                proposal, key, observation, partition, *conditions
            ).astype(dtype)
            transition = contract.log_density_all(dynamics, partition, substates, *conditions)
            density = contract.proposal_log_density_all(
                proposal, observation, partition, substates, *conditions
            )
            return substates, (transition - density).astype(dtype)

        def either() -> tuple[jax.Array, jax.Array]:
            if seen is None:
                return proposed()
            if seen is np.False_:
                return moved()
            if not seen.ndim:
                return lax.cond(seen, proposed, moved)
            here = seen[partition]
            return jax.tree.map(lambda x, y: jnp.where(here, x, y), proposed(), moved())

        like = conditions[0], jnp.zeros(partition.shape, dtype)
        substates, log_weight = _once(shared, either, like=like)
        chex.assert_equal_shape((substates, conditions[0]))
        return Drawn(partition, source, conditions, substates, log_weight)


class Scored(Motion):
    """Stops the draws of another strategy; their density's derivative goes to the weights.

    Whatever the draws come from, only the transition density depends on the dynamics'
    parameters: a proposal's own density is stopped like its draws.
    """

    def __init__(self, drawn_by: Motion):
        self.drawn_by = drawn_by

    def check(self, tracker: "Partitioned") -> None:
        """See ``Motion``."""
        self.drawn_by.check(tracker)
        moves_labels = hasattr(tracker.dynamics, "propagate_label")
        if tracker.initial_label is None or not moves_labels:
            return
        if not contract.has_log_label(tracker.dynamics):
            raise InputError(
                f"motion_gradient='score' needs the probability of a label's move, and "
                f"{type(tracker.dynamics).__name__} has none; add the method log_label(new, "
                "label, substates) -> [], the log-probability with which propagate_label draws."
            )

    def begin(self, tracker, key, state, observation) -> "Scored":
        """See ``Motion``."""
        return Scored(self.drawn_by.begin(tracker, key, state, observation))

    def draw(self, shared, key, partition, source, conditions, others) -> Drawn:
        """See ``Motion``."""
        drawn = self.drawn_by.draw(shared, key, partition, source, conditions, others)
        drawn = drawn._replace(substates=lax.stop_gradient(drawn.substates))
        if drawn.log_weight is not None:
            drawn = drawn._replace(log_weight=lax.stop_gradient(drawn.log_weight))
        score = contract.log_density_all(
            shared.tracker.dynamics, partition, drawn.substates, *drawn.conditions
        )
        return drawn._replace(score=score.astype(drawn.substates.dtype))


def motion_of(tracker: "Partitioned") -> Motion:
    """The strategy that a tracker's settings ask for."""
    motion = Motion()
    if tracker.proposal is not None:
        motion = Proposed(tracker.proposal)
    elif tracker.relocation is not None:
        motion = Relocating()
    return Scored(motion) if tracker.motion_gradient == "score" else motion


def _once(shared: Shared, function: Callable[[], Any], like: Any) -> Any:
    """``function()``, computed once however often it is used."""
    unforeseen = shared.tracker.ordering.order[0, 0] >= 0
    return computed_once(function, like=like, unforeseen=unforeseen)
