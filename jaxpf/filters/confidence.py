"""How sure it is that an object is still there, for likelihoods that can tell (``log_odds``).

What a likelihood says of one frame's estimate is smoothed in the log domain: half of what is known
is of this frame, a quarter of the one before, and so on.  Nobody waits for frames to come, and a
blink is not a loss.

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
#: Log odds at the start: somebody said that the object is there.
_AT_START = 3.0
#: No single frame is surer than that: what it says is forgotten in a few more.
_MOST = 6.0


def at_start(likelihood: Any, num_partitions: int, dtype: Any) -> jax.Array | None:
    """Log odds ``[P]`` just before the first frame; None where the likelihood cannot tell."""
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
    return (
        dataclasses.replace(state, log_odds=smooth),
        dataclasses.replace(summary, confidence=jax.nn.sigmoid(smooth)),
    )
