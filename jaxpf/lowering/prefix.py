"""Running sums and maxima over contiguous segments.

On a CPU, both methods below are several times faster than ``jnp.cumsum``.

Floating-point sums add one value after the other with a ``lax.scan`` over the particles, vectorised
over runs.  The result is therefore non-decreasing and constant where a term is zero.  Resampling
relies on both: a particle of zero weight then never has offspring.  (Blocks, unrolled or scanned,
were no faster and took four times as long to compile.)  Integer sums and maxima do not depend on
the order, so they use log2(N) doubling passes, which also vectorise over the particles.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.lowering import platform

#: Up to this number of values, doubling is faster than the sequential scan.
_SHORT = 2048


def running_sum(values: jax.Array, rank: jax.Array | None = None) -> jax.Array:
    """Inclusive running sum of ``values`` ``[N]`` within contiguous segments.

    Non-decreasing for values >= 0, and constant across zeros, on every platform.

    Args:
        values: ``[N]``.
        rank: ``[N]`` int32, each value's index in its segment, from 0; default one segment.
    """
    return held(quick_sum(values, rank), values, rank)


def quick_sum(values: jax.Array, rank: jax.Array | None = None) -> jax.Array:
    """``running_sum``, which on an accelerator may decrease and vary across zeros by rounding."""
    zero = jnp.zeros((), values.dtype)
    if _is_exact(values) and _is_short(values):
        return _doubling(jnp.add, zero, values, rank)
    if not platform.on_accelerator():
        return _sequential(jnp.add, zero, values, rank)
    return _parallel(jnp.add, values, rank)


def held(sums: jax.Array, values: jax.Array, rank: jax.Array | None = None) -> jax.Array:
    """Make a ``quick_sum`` of values >= 0 non-decreasing, and constant across zeros."""
    if _is_exact(sums) or not platform.on_accelerator():
        return sums
    # Carry the sum at the last positive term forward.
    return _parallel(jnp.maximum, jnp.where(values > 0, sums, 0), rank)


def running_max(values: jax.Array, rank: jax.Array | None = None) -> jax.Array:
    """Inclusive running maximum of ``values`` ``[N]``; arguments as for ``running_sum``."""
    exact = _is_exact(values)
    smallest = jnp.array(jnp.iinfo(values.dtype).min if exact else -jnp.inf, values.dtype)
    if _is_short(values):
        return _doubling(jnp.maximum, smallest, values, rank)
    if not platform.on_accelerator():
        return _sequential(jnp.maximum, smallest, values, rank)
    return _parallel(jnp.maximum, values, rank)


def _is_exact(values: jax.Array) -> bool:
    return jnp.issubdtype(values.dtype, jnp.integer)


def _is_short(values: jax.Array) -> bool:
    return not platform.on_accelerator() and values.shape[0] <= _SHORT


def _doubling(
    combine: Callable, identity: jax.Array, values: jax.Array, rank: jax.Array | None
) -> jax.Array:
    """Prefix combination in which every pass doubles the reach of each value."""
    count = values.shape[0]
    before = jnp.full((count,), identity)

    def extend(step, reached):
        reach = jnp.left_shift(1, step)
        earlier = lax.dynamic_slice(jnp.concatenate([before, reached]), (count - reach,), (count,))
        if rank is not None:
            earlier = jnp.where(rank >= reach, earlier, identity)
        return combine(earlier, reached)

    return lax.fori_loop(0, (count - 1).bit_length(), extend, values)


def _sequential(
    combine: Callable, identity: jax.Array, values: jax.Array, rank: jax.Array | None
) -> jax.Array:
    """Sequential prefix combination."""

    def extend(total, item):
        value, restart = item
        total = combine(total, value)
        if restart is not None:
            total = jnp.where(restart, value, total)
        return total, total

    first = None if rank is None else rank == 0
    return lax.scan(extend, identity, (values, first))[1]


def _parallel(combine: Callable, values: jax.Array, rank: jax.Array | None) -> jax.Array:
    """Prefix combination for accelerators: one operation, in segments of logarithmic depth."""
    if rank is None:
        return (lax.cumsum if combine is jnp.add else lax.cummax)(values)

    def join(left, right):
        return jnp.where(right[1], right[0], combine(left[0], right[0])), left[1] | right[1]

    return lax.associative_scan(join, (values, rank == 0))[0]
