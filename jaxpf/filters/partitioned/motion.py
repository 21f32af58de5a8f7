"""Strategies that draw a stage's substates; the kernel calls them once per frame and per stage.

``motion_of`` chooses one from a tracker's settings.  If draws do not follow the transition density,
the strategy corrects for it by a weight per draw, ``Drawn.log_weight``.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.optional import optional
from jaxpf.contract.state import ParticleState
from jaxpf.contract.types import ProposalLike
from jaxpf.filters.noiseless import noiseless, without_noise
from jaxpf.filters.partitioned import labels
from jaxpf.filters.partitioned.carry import Drawn, Shared, Turn
from jaxpf.filters.partitioned.settings import Settings
from jaxpf.lowering.branches import computed_once


class FromDynamics:
    """Draws from the dynamics, without weights."""

    def check(self, tracker: Settings) -> None:
        """Refuse a tracker that is incompatible with the strategy."""

    def cases(self, tracker: Settings) -> Iterator[Any]:
        """Cases to refuse that depend on values, for ``contract.refusals.refused``."""
        return iter(())

    def begin(
        self, tracker: Settings, key: jax.Array, state: ParticleState, observation: Any
    ) -> "FromDynamics":
        """Prepare the strategy for one frame, given the weighted set of the previous frame."""
        return self

    def draw(self, shared: Shared, key: jax.Array, turn: Turn) -> Drawn:
        """Draw one substate for every particle."""
        dynamics, like = shared.tracker.dynamics, turn.conditions[0]

        def move() -> jax.Array:
            moved = contract.propagate_all(
                dynamics, key, turn.partition, *turn.conditions, *turn.others
            )
            return moved.astype(like.dtype)

        return Drawn(turn.partition, turn.source, turn.conditions, _once(shared, move, like))


class Proposed(FromDynamics):
    """Draws from a ``jaxpf.contract.Proposal``, or from the dynamics for missing partitions."""

    def __init__(self, proposal: ProposalLike):
        self.proposal = proposal

    def check(self, tracker: Settings) -> None:
        """See ``FromDynamics``."""
        calls.check_uncoupled(tracker.dynamics, "a proposal")

    def cases(self, tracker: Settings) -> Iterator[Any]:
        """See ``FromDynamics``."""
        if optional(self.proposal, "needs_noise"):
            what = f"proposal {type(self.proposal).__name__}"
            yield without_noise(what, tracker, noiseless(tracker).ignored)

    def draw(self, shared: Shared, key: jax.Array, turn: Turn) -> Drawn:
        """See ``FromDynamics``: the weight is the transition density over the proposal density."""
        dynamics, partition, conditions = shared.tracker.dynamics, turn.partition, turn.conditions
        likelihood, observation, seen = calls.as_seen(shared.tracker.likelihood, shared.observation)
        proposal = calls.proposal_of(self.proposal, dynamics, likelihood)
        like = conditions[0], jnp.zeros(partition.shape, conditions[0].dtype)

        def move() -> tuple[jax.Array, jax.Array]:
            substates = contract.propagate_all(dynamics, key, partition, *conditions)
            return substates.astype(like[0].dtype), like[1]

        def propose() -> tuple[jax.Array, jax.Array]:
            substates = calls.propose_all(proposal, key, observation, partition, *conditions)
            substates = substates.astype(like[0].dtype)
            move = partition, substates, *conditions
            log_weight = contract.log_density_all(dynamics, *move)
            log_weight -= calls.proposal_log_density_all(proposal, observation, *move)
            return substates, log_weight.astype(like[1].dtype)

        def either() -> tuple[jax.Array, jax.Array]:
            if seen is None:
                return propose()
            if seen is np.False_:
                return move()
            if not seen.ndim:
                return lax.cond(seen, propose, move)
            return jax.tree.map(partial(jnp.where, seen[partition]), propose(), move())

        substates, log_weight = _once(shared, either, like)
        chex.assert_equal_shape((substates, like[0]))
        return Drawn(partition, turn.source, conditions, substates, log_weight)


class Scored(FromDynamics):
    """Stops the gradient of another strategy's draws and adds their density's to the weights.

    Only the transition density in the weights depends on the dynamics' parameters: a proposal's
    density is stopped like its draws.
    """

    def __init__(self, inner: FromDynamics):
        self.inner = inner

    def check(self, tracker: Settings) -> None:
        """See ``FromDynamics``."""
        self.inner.check(tracker)
        if labels.moves_labels(tracker) and not calls.has_log_label(tracker.dynamics):
            raise InputError(
                "motion_gradient='score' needs the method log_label(new, label, substates) -> [] "
                f"of the dynamics, and {type(tracker.dynamics).__name__} has none; write it."
            )

    def cases(self, tracker: Settings) -> Iterator[Any]:
        """See ``FromDynamics``."""
        yield from self.inner.cases(tracker)
        yield without_noise("motion_gradient='score'", tracker, noiseless(tracker).moved)

    def begin(self, tracker, key, state, observation) -> "Scored":
        """See ``FromDynamics``."""
        return Scored(self.inner.begin(tracker, key, state, observation))

    def draw(self, shared: Shared, key: jax.Array, turn: Turn) -> Drawn:
        """See ``FromDynamics``."""
        drawn = self.inner.draw(shared, key, turn)
        substates, log_weight = lax.stop_gradient((drawn.substates, drawn.log_weight))
        score = contract.log_density_all(
            shared.tracker.dynamics, drawn.partition, substates, *drawn.conditions
        ).astype(substates.dtype)
        return drawn._replace(substates=substates, log_weight=log_weight, score=score)


def motion_of(tracker: Settings) -> FromDynamics:
    """Choose the strategy for a tracker's settings."""
    motion = FromDynamics()
    if tracker.proposal is not None:
        motion = Proposed(tracker.proposal)
    return Scored(motion) if tracker.motion_gradient == "score" else motion


def _once(shared: Shared, function: Callable[[], Any], like: Any) -> Any:
    """``function()``, computed once for all its uses."""
    unforeseen = shared.tracker.ordering.order[0, 0] >= 0
    return computed_once(function, like, unforeseen)
