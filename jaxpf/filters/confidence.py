"""Confidence that an object is still present, for likelihoods with ``log_odds``.

The log odds at a frame's estimate are smoothed over time with weights 1/2 for this frame, 1/4 for
the previous one, and so on.  This needs no future frames, and a short drop is not reported as a
loss.

An object that was lost at the frame's border has probably left, and what looks like it now is
probably another.  Until the smoothed log odds exceed 4, it is not back: with prior odds of 1 to 55,
its confidence is that of the log odds less 4.

Of two boxes in one place the one with the lower smoothed log odds is doubtful: probably both show
the same object.  Crossing objects also meet, for a few frames, so the frames count with weights
.03, .03 * .97, ..., and the log odds are lowered by four times their mean.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.typing import DTypeLike

from jaxpf.contract import calls
from jaxpf.contract.calls import optional
from jaxpf.contract.state import Presence, Summary
from jaxpf.contract.types import LikelihoodLike

#: Weight of the previous frames' smoothed log odds.
_MEMORY = 0.5
#: Initial log odds: the user marked the object, so it is present.
_AT_START = 3.0
#: Bound of a single frame's log odds, so that a few further frames can outweigh it.
_MOST = 6.0
#: Log odds against the return of an object that left.
_RETURN = 4.0
#: Log odds against the weaker one of two objects in one place, and weight of a frame.
_TOGETHER, _RECENT = 4.0, 0.03


def at_start(likelihood: LikelihoodLike, num_partitions: int, dtype: DTypeLike) -> Presence | None:
    """``presence`` of a state before the first frame, as far as the likelihood defines it."""
    if not calls.has_log_odds(likelihood):
        return None
    leaves = optional(likelihood, "reaches_border") is not None
    meets = num_partitions > 1 and optional(likelihood, "same_place") is not None
    return Presence(
        log_odds=jnp.full((num_partitions,), _AT_START, dtype),
        left=jnp.zeros((num_partitions,), bool) if leaves else None,
        together=jnp.zeros((num_partitions,), dtype) if meets else None,
    )


def reported(
    likelihood: Any, before: Any, state: Any, summary: Summary, observation: Any
) -> tuple[Any, Any]:
    """Count a frame in the state's time, and add the confidence in the estimate to its report.

    Args:
        likelihood: may define ``log_odds``.
        before: state after the previous frame.
        state: state after this frame.
        summary: this frame's summary.
        observation: this frame's observation.
    """
    state = dataclasses.replace(state, time=before.time + 1)
    if before.presence is None:
        return state, summary
    # Confidence is for reporting only, so it has no derivative.
    estimate = lax.stop_gradient(summary.estimate)
    partitions, past = jnp.arange(estimate.shape[0]), before.presence
    odds = calls.log_odds_all(likelihood, observation, partitions, estimate.T)
    odds = lax.stop_gradient(odds.astype(past.log_odds.dtype))
    odds = jnp.where(jnp.isnan(odds), -_MOST, jnp.clip(odds, -_MOST, _MOST))
    smooth = _MEMORY * past.log_odds + (1 - _MEMORY) * odds
    left, together = past.left, past.together
    if left is not None:
        leaves = (smooth < 0) & likelihood.reaches_border(partitions, estimate.T)
        left = (left | leaves) & (smooth < _RETURN)
    if together is not None:
        shared = likelihood.same_place(partitions, estimate.T)
        shared = jnp.where((smooth[:, None] < smooth) & (shared > 0), shared, 0)
        together += _RECENT * (jnp.max(shared, axis=1).astype(together.dtype) - together)
    now = Presence(smooth, left, together)
    *_, seen = calls.as_seen(likelihood, observation)
    if seen is not None:  # confidence does not change in a missing frame
        now = jax.tree.map(lambda new, old: jnp.where(seen, new, old), now, past)
    shown = now.log_odds
    if now.left is not None:
        shown -= jnp.where(now.left, _RETURN, 0)
    if now.together is not None:
        shown -= _TOGETHER * now.together
    return (
        dataclasses.replace(state, presence=now),
        dataclasses.replace(summary, confidence=jax.nn.sigmoid(shown)),
    )
