"""Confidence that an object is still there, for likelihoods with ``log_odds``.

The log odds of a frame's estimate are smoothed over time: this frame counts half, the one before a
quarter, and so on.  It needs no future frames, and a blink is not a loss.

Learned appearance can tell.  From the start frames of nine annotated clips, four of which its
level was calibrated on (8 runs), the area under the ROC curve for "overlap below .1" is .84; of the
boxes with a confidence below .2 12 % are on their object, from .2 to .8 some 60 %, above .8 88 %.
It is no certificate: who is taken for a look-alike looks sure.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf import contract
from jaxpf.contract.state import Summary

#: Share of the frames before.
_MEMORY = 0.5
#: Log odds at the start: the user says that the object is there.
_AT_START = 3.0
#: Bound of a single frame's log odds, so that a few more frames outweigh it.
_MOST = 6.0


def at_start(likelihood: Any, num_partitions: int, dtype: Any) -> jax.Array | None:
    """Log odds ``[P]`` just before the first frame; None without ``log_odds``."""
    if not contract.has_log_odds(likelihood):
        return None
    return jnp.full((num_partitions,), _AT_START, dtype)


def reported(
    likelihood: Any, before: Any, state: Any, summary: Summary, observation: Any
) -> tuple[Any, Any]:
    """A frame's state and summary, with the confidence in its estimate.

    Args:
        likelihood: which is asked.
        before: the state of the frame before; states have ``log_odds``.
        state: of this frame.
        summary: of this frame.
        observation: of this frame.
    """
    if before.log_odds is None:
        return state, summary
    # Reported and looked at, but nothing to learn from: it has no derivative.
    estimate = lax.stop_gradient(summary.estimate)
    partitions = jnp.arange(estimate.shape[0])
    now = contract.log_odds_all(likelihood, observation, partitions, estimate.T)
    now = lax.stop_gradient(now.astype(before.log_odds.dtype))
    now = jnp.where(jnp.isnan(now), -_MOST, jnp.clip(now, -_MOST, _MOST))
    smooth = _MEMORY * before.log_odds + (1 - _MEMORY) * now
    observed = contract.was_observed(likelihood, observation)
    if observed is not True:
        smooth = jnp.where(observed, smooth, before.log_odds)
    return (
        dataclasses.replace(state, log_odds=smooth),
        dataclasses.replace(summary, confidence=jax.nn.sigmoid(smooth)),
    )
