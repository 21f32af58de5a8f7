"""Running sums and maxima over contiguous segments, in strictly sequential order.

Why not ``jnp.cumsum``: on CPU a ``lax.scan`` over the particles, vectorised over the
runs, is several times faster, and its additions happen in order, so the result never
decreases and does not change where a term is zero.  Resampling relies on both: a
particle of zero weight then never has offspring.
"""

import jax
import jax.numpy as jnp
from jax import lax


def segment_starts(segment: jax.Array) -> jax.Array:
    """``[N]`` bool: where a run of equal ids begins in ``segment`` ``[N]``."""
    return jnp.concatenate([jnp.ones((1,), bool), segment[1:] != segment[:-1]])


def running_sum(values: jax.Array, first: jax.Array | None = None) -> jax.Array:
    """Inclusive running sum of ``values`` ``[N]``, restarting where ``first`` is true.

    Never decreasing for values >= 0, and constant across zeros, on every platform.
    """
    if first is None:
        first = jnp.zeros(values.shape, bool)
    return lax.platform_dependent(
        values, first, cpu=_running_sum_sequential, default=_running_sum_parallel
    )


def running_max(values: jax.Array, first: jax.Array) -> jax.Array:
    """Inclusive running maximum of ``values`` ``[N]``, restarting where ``first`` is true."""

    def sequential(values, first):
        def body(carry, item):
            value, restart = item
            carry = jnp.where(restart, value, jnp.maximum(carry, value))
            return carry, carry

        return lax.scan(body, values[0], (values, first))[1]

    def parallel(values, first):
        return lax.associative_scan(
            lambda a, b: (jnp.where(b[1], b[0], jnp.maximum(a[0], b[0])), a[1] | b[1]),
            (values, first),
        )[0]

    return lax.platform_dependent(values, first, cpu=sequential, default=parallel)


def _running_sum_sequential(values, first):
    def body(carry, item):
        value, restart = item
        carry = jnp.where(restart, value, carry + value)
        return carry, carry

    return lax.scan(body, jnp.zeros_like(values[0]), (values, first))[1]


def _running_sum_parallel(values, first):
    sums, _ = lax.associative_scan(
        lambda a, b: (jnp.where(b[1], b[0], a[0] + b[0]), a[1] | b[1]), (values, first)
    )
    # A parallel sum may wobble by a rounding error: carry the last positive term's value
    # forward, so that zeros keep the sum exactly constant.
    return running_max(jnp.where(values > 0, sums, jnp.zeros_like(sums)), first)
