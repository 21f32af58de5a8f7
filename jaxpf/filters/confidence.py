"""Confidence that an object is still present, for likelihoods with ``log_odds``.

The log odds at a frame's estimate are smoothed over time with weights 1/2 for this frame, 1/4 for
the previous one, and so on.  This needs no future frames, and a short drop is not reported as a
loss.

Measured with learned appearance, from the start frames of nine annotated clips, four of which were
used for calibration (8 runs): the area under the ROC curve for "overlap below .1" is .84.  Boxes
with a confidence below .2 are on their object in 12 % of the cases, from .2 to .8 in about 60 %,
above .8 in 88 %.  High confidence is no guarantee: a track on a look-alike also has high
confidence.

An object that was lost at the frame's border has probably left, and what looks like it now is
probably another.  Until the smoothed log odds exceed 4, it is not back: with prior odds of 1 to 55,
its confidence is that of the log odds less 4.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.typing import DTypeLike

from jaxpf import contract
from jaxpf.contract.state import Summary

#: Weight of the previous frames' smoothed log odds.
_MEMORY = 0.5
#: Initial log odds: the user marked the object, so it is present.
_AT_START = 3.0
#: Bound of a single frame's log odds, so that a few further frames can outweigh it.
_MOST = 6.0
#: Log odds against the return of an object that left.
_RETURN = 4.0


def at_start(likelihood: Any, num_partitions: int, dtype: DTypeLike) -> dict[str, jax.Array]:
    """Fields ``log_odds`` and ``left`` ``[P]`` of a state just before the first frame.

    Only those that the likelihood defines.
    """
    if not contract.has_log_odds(likelihood):
        return {}
    odds = {"log_odds": jnp.full((num_partitions,), _AT_START, dtype)}
    left = {"left": jnp.zeros((num_partitions,), bool)}
    return odds | left if contract.has_border(likelihood) else odds


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
    if before.log_odds is None:
        return state, summary
    # Confidence is for reporting only, so it has no derivative.
    estimate = lax.stop_gradient(summary.estimate)
    partitions = jnp.arange(estimate.shape[0])
    now = contract.log_odds_all(likelihood, observation, partitions, estimate.T)
    now = lax.stop_gradient(now.astype(before.log_odds.dtype))
    now = jnp.where(jnp.isnan(now), -_MOST, jnp.clip(now, -_MOST, _MOST))
    smooth = _MEMORY * before.log_odds + (1 - _MEMORY) * now
    left = before.left
    if left is not None:
        leaves = (smooth < 0) & likelihood.reaches_border(partitions, estimate.T)
        left = (left | leaves) & (smooth < _RETURN)
    *_, seen = contract.as_seen(likelihood, observation)
    if seen is not None:  # confidence does not change in a missing frame
        smooth = jnp.where(seen, smooth, before.log_odds)
        left = None if left is None else jnp.where(seen, left, before.left)
    shown = smooth if left is None else smooth - jnp.where(left, _RETURN, 0)
    return (
        dataclasses.replace(state, log_odds=smooth, left=left),
        dataclasses.replace(summary, confidence=jax.nn.sigmoid(shown)),
    )
