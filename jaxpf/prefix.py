"""Running sums and maxima over contiguous segments, in strictly sequential order.

Why not ``jnp.cumsum``: on CPU a ``lax.scan`` over the particles, vectorised over the
runs, is several times faster, and its additions happen in order, so the result never
decreases and does not change where a term is zero.  Resampling relies on both: a
particle of zero weight then never has offspring.  (Blocks, unrolled or scanned, were
slower or no faster, and took four times as long to compile.)
"""

from collections.abc import Callable

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
    zero = jnp.zeros((), values.dtype)
    if _on_cpu():
        return _sequential(jnp.add, zero, values, first)
    sums = _parallel(jnp.add, values, first)
    # A parallel sum may wobble by a rounding error: carry the last positive term's value
    # forward, so that zeros keep the sum exactly constant.
    return _parallel(jnp.maximum, jnp.where(values > 0, sums, zero), first)


def running_max(values: jax.Array, first: jax.Array | None = None) -> jax.Array:
    """Inclusive running maximum of ``values`` ``[N]``, restarting where ``first`` is true."""
    if _on_cpu():
        return _sequential(jnp.maximum, jnp.array(-jnp.inf, values.dtype), values, first)
    return _parallel(jnp.maximum, values, first)


def _on_cpu() -> bool:
    # Not lax.platform_dependent: it traces both forms at every call, and the parallel one
    # made up most of the time to trace a filter.
    return jax.default_backend() == "cpu"


def _sequential(
    combine: Callable, identity: jax.Array, values: jax.Array, first: jax.Array | None
) -> jax.Array:
    """Prefix combination, one value after the other."""

    def extend(total, item):
        value, restart = item
        total = combine(total, value)
        if restart is not None:
            total = jnp.where(restart, value, total)
        return total, total

    return lax.scan(extend, identity, (values, first))[1]


def _parallel(combine: Callable, values: jax.Array, first: jax.Array | None) -> jax.Array:
    """Prefix combination in logarithmic depth, for accelerators."""
    if first is None:
        return lax.associative_scan(combine, values)

    def join(left, right):
        return jnp.where(right[1], right[0], combine(left[0], right[0])), left[1] | right[1]

    return lax.associative_scan(join, (values, first))[0]
