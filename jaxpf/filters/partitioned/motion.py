"""A stage's draws: by the dynamics or a proposal, with one of two gradients."""

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
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError
from jaxpf.filters.noiseless import without_noise
from jaxpf.filters.partitioned.carry import Settings, Shared
from jaxpf.lowering.branches import computed_once

Past = tuple[jax.Array, jax.Array, jax.Array]


def draw(
    shared: Shared, key: jax.Array, partition: jax.Array, past: Past, others: tuple[jax.Array, ...]
) -> tuple[jax.Array, jax.Array | None, jax.Array | None]:
    """Draw one substate for every particle.

    ``motion_gradient="score"`` stops the gradient of the draws and adds their density's to the
    weights.  Only the transition density in the weights then depends on the dynamics' parameters:
    a proposal's density is stopped like its draws.

    Args:
        shared: data of the frame.
        key: a random key.
        partition: ``[N]`` int32, the partition that each particle draws.
        past: three arrays ``[D, N]``: its substates of the two previous frames, and its parent's of
            this frame.
        others: for coupled dynamics, all substates of the previous frame, ``[P, D, N]``; else
            empty.

    Returns:
        ``substates``, ``log_weight`` and ``score``, see ``Drawn``.
    """
    tracker = shared.tracker
    substates, log_weight = (
        _moved(shared, key, partition, past, others)
        if tracker.proposal is None
        else _proposed(shared, key, partition, past)
    )
    if tracker.motion_gradient != "score":
        return substates, log_weight, None
    substates, log_weight = lax.stop_gradient((substates, log_weight))
    score = contract.log_density_all(tracker.dynamics, partition, substates, *past)
    return substates, log_weight, score.astype(substates.dtype)


def _moved(shared, key, partition, past, others) -> tuple[jax.Array, None]:
    """Draw from the dynamics, without weights."""

    def move() -> jax.Array:
        dynamics = shared.tracker.dynamics
        moved = contract.propagate_all(dynamics, key, partition, *past, *others)
        return moved.astype(past[0].dtype)

    return _once(shared, move, past[0]), None


def _proposed(shared, key, partition, past) -> tuple[jax.Array, jax.Array]:
    """Draw from the proposal; the weight is the transition density over the proposal density.

    Partitions that were not seen move by the dynamics.
    """
    dynamics, dtype = shared.tracker.dynamics, past[0].dtype
    likelihood, observation, seen = calls.as_seen(shared.tracker.likelihood, shared.observation)
    proposal = calls.proposal_of(shared.tracker.proposal, dynamics, likelihood)
    like = past[0], jnp.zeros(partition.shape, dtype)

    def move() -> tuple[jax.Array, jax.Array]:
        return contract.propagate_all(dynamics, key, partition, *past).astype(dtype), like[1]

    def propose() -> tuple[jax.Array, jax.Array]:
        substates = calls.propose_all(proposal, key, observation, partition, *past).astype(dtype)
        log_weight = contract.log_density_all(dynamics, partition, substates, *past)
        log_weight -= calls.proposal_log_density_all(
            proposal, observation, partition, substates, *past
        )
        return substates, log_weight.astype(dtype)

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
    return substates, log_weight


def _once(shared: Shared, function: Callable[[], Any], like: Any) -> Any:
    """``function()``, computed once for all its uses."""
    unforeseen = shared.tracker.ordering.order[0, 0] >= 0
    return computed_once(function, like, unforeseen)


def cases(tracker: Settings) -> Iterator[Any]:
    """Models that do not work with a proposal or a score, for ``contract.refusals.refused``."""
    if tracker.proposal is not None:
        calls.check_uncoupled(tracker.dynamics, "a proposal")
        if optional(tracker.proposal, "needs_noise"):
            yield without_noise(f"proposal {type(tracker.proposal).__name__}", tracker)
    if tracker.motion_gradient == "score":
        if tracker.moves_labels and not calls.has_log_label(tracker.dynamics):
            raise InputError(
                "motion_gradient='score' needs the method log_label(new, label, substates) -> [] "
                f"of the dynamics, and {type(tracker.dynamics).__name__} has none; write it."
            )
        yield without_noise("motion_gradient='score'", tracker, moved=True)
