"""Weights and evidence as logarithms, without needless rounding.

A log-likelihood may carry a large constant: beside 1e7, float32 holds only whole numbers.  The
largest value is therefore taken out of a factor before anything is added to it, and joins the
evidence alone.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.contract.pytree import is_concrete


def normalised(
    log_values: jax.Array, largest: jax.Array | None = None
) -> tuple[jax.Array, jax.Array]:
    """Shift values ``[..., N]`` so that their exponentials sum to one; also return the sum's log.

    Values that are all -inf stay so, with a finite derivative.  ``largest`` is the largest value,
    if already known.
    """
    if largest is None:
        largest = jnp.max(log_values, axis=-1)
    largest = lax.stop_gradient(largest)[..., None]
    possible = ~jnp.isneginf(largest)
    relative = log_values - finite(largest)
    total = jnp.log(jnp.sum(jnp.exp(jnp.where(possible, relative, 0.0)), -1, keepdims=True))
    shifted = jnp.where(possible, relative - total, log_values)
    return shifted, jnp.where(possible, largest + total, -jnp.inf)[..., 0]


def multiplied(log_weights: jax.Array, log_factor: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Multiply weights ``[..., N]`` by a factor; return them normalised, and the log total."""
    largest = finite(lax.stop_gradient(jnp.max(counted(log_factor, log_weights), -1)))
    log_weights, total = normalised(log_weights + (log_factor - largest[..., None]))
    return log_weights, largest + total


def counted(log_factor: jax.Array, log_weights: jax.Array) -> jax.Array:
    """``log_factor``, and -inf where the weight is zero."""
    return jnp.where(jnp.isneginf(log_weights), -jnp.inf, log_factor)


def finite(log_values: jax.Array) -> jax.Array:
    """``log_values``, and 0 for -inf."""
    return jnp.where(jnp.isneginf(log_values), 0.0, log_values)


def add_exactly(total: jax.Array, value: jax.Array) -> jax.Array:
    """Add to a total ``[2, ...]``, a rounded sum and what rounding has lost (Knuth's two-sum).

    Compare totals by the sum of their difference: what is large and equal cancels, and what was
    lost remains.
    """
    rounded = total[0] + value
    added = rounded - total[0]
    lost = (total[0] - (rounded - added)) + (value - added)
    return jnp.stack([rounded, jnp.where(jnp.isfinite(rounded), total[1] + lost, 0)])


def log_evidence(summaries: Any, axis: int = -1) -> Any:
    """Log evidence of a sequence: the sum of the frames' ``log_evidence``, without drift.

    In float32, a running sum of 1e5 increments is wrong in its first decimals.  This sum is made
    in float64 with NumPy or, inside a trace, pairwise: its error does not grow with the number of
    frames, and it can be differentiated.

    Example::

        _, summary = jaxpf.run(tracker, key, y)
        jaxpf.log_evidence(summary)  # an estimate of log p(y_1:T)

    Args:
        summaries: of ``jaxpf.run`` or ``jaxpf.monte_carlo``, or their ``log_evidence`` alone.
        axis: the axis of frames; the last of what these functions return.

    Returns:
        One number for each run, ``[]`` or ``[R]``.
    """
    values = getattr(summaries, "log_evidence", summaries)
    if is_concrete(values):
        return np.sum(np.asarray(values, np.float64), axis=axis)
    return sum_evenly(jnp.asarray(values), axis)


def sum_evenly(values: jax.Array, axis: int = -1) -> jax.Array:
    """Pairwise sum, whose rounding error grows with the logarithm of the number of terms."""
    values = jnp.moveaxis(values, axis, -1)
    while (half := values.shape[-1] // 2) > 0:
        pairs = values[..., :half] + values[..., half : 2 * half]
        values = jnp.concatenate([pairs, values[..., 2 * half :]], axis=-1)
    return jnp.sum(values, axis=-1)
