"""JAX's random numbers, drawn faster on a CPU.

To shorten compilation, JAX lowers its generator (Threefry-2x32; Salmon, Moraes, Dror & Shaw 2011,
"Parallel random numbers: as easy as 1, 2, 3") on a CPU to a loop over rounds, each of which reads
and writes whole arrays.  With the twenty rounds unrolled, a draw is one pass that fuses with its
users: the same bits in about a third of the time.  This saves a tenth of the time of a frame of
boxes, and more if the likelihood is cheap or every particle has its own key.  Only the key's type
selects the implementation, so ``jax.random`` works with both, in users' models too.
"""

from collections.abc import Callable, Sequence
from functools import wraps
from math import prod

import jax
import jax.numpy as jnp
from jax import lax
from jax.extend import random as extended

from jaxpf.lowering import platform

_THREEFRY = extended.threefry_prng_impl
_ROTATIONS = (13, 15, 26, 6), (17, 29, 16, 24)
#: Fewer keys than this are split by JAX's implementation, which compiles faster.
_MANY = 32


def written_out(key: jax.Array) -> jax.Array:
    """Return a key with the same draws, bit for bit, that take less time on a CPU.

    Returns keys of other implementations, or on other platforms, unchanged.
    """
    # Without this setting JAX numbers the draws differently.
    partitionable = getattr(jax.config, "jax_threefry_partitionable", True)
    is_threefry = jax.random.key_impl(key) == "threefry2x32"
    if platform.on_accelerator() or not (partitionable and is_threefry):
        return key
    return jax.random.wrap_key_data(jax.random.key_data(key), impl=_WRITTEN_OUT)


def with_written_out_key(method: Callable) -> Callable:
    """Let a tracker's method ``(self, key, ...)`` draw with ``written_out(key)``.

    ``jax.random.poisson`` takes JAX's own kind of key alone: a model that uses it gets that one.
    """

    @wraps(method)
    def drawing(self, key, *arguments):
        try:
            return method(self, written_out(key), *arguments)
        except NotImplementedError as error:
            if _THREEFRY.name not in str(error):
                raise
        return method(self, key, *arguments)

    return drawing


def key_at(keys: jax.Array, place: jax.Array) -> jax.Array:
    """Return ``keys[place]``; ``jax_debug_key_reuse`` takes any two of ``keys[place]`` for one key.

    It follows keys by array, not by place, and so would refuse a loop that reads a new key in each
    turn.
    """
    return jax.random.wrap_key_data(
        jax.random.key_data(keys)[place], impl=jax.random.key_impl(keys)
    )


def _hash(key: jax.Array, shape: Sequence[int]) -> tuple[jax.Array, jax.Array]:
    """Two words for each position of ``shape``, hashed from its index."""
    size = prod(shape)
    if size >= 2**32:
        raise NotImplementedError(f"a draw of {size} numbers; draw fewer than 2^32 at once.")
    keys = key[0], key[1], key[0] ^ key[1] ^ jnp.uint32(0x1BD11BDA)
    left = jnp.broadcast_to(keys[0], shape)
    right = lax.iota(jnp.uint32, size).reshape(shape) + keys[1]
    for group in range(5):
        for rotation in _ROTATIONS[group % 2]:
            left = left + right
            right = (right << jnp.uint32(rotation)) | (right >> jnp.uint32(32 - rotation))
            right = left ^ right
        left = left + keys[(group + 1) % 3]
        right = right + keys[(group + 2) % 3] + jnp.uint32(group + 1)
    return left, right


def _random_bits(key, bit_width, shape):
    if bit_width < 32:
        return _THREEFRY.random_bits(key, bit_width, shape)
    left, right = _hash(key, shape)
    if bit_width == 32:
        bits = left ^ right
    else:
        bits = (left.astype(jnp.uint64) << jnp.uint64(32)) | right.astype(jnp.uint64)
    # Fused with what uses them, twenty rounds are computed anew for each use, and LLVM's vectoriser
    # takes minutes for them (jaxlib 0.12, 64 bits).
    return lax.optimization_barrier(bits)


def _split(key, shape):
    if prod(shape) < _MANY:
        return _THREEFRY.split(key, shape)
    return jnp.stack(_hash(key, shape), axis=-1)


_WRITTEN_OUT = extended.define_prng_impl(
    key_shape=(2,),
    seed=_THREEFRY.seed,
    split=_split,
    random_bits=_random_bits,
    fold_in=_THREEFRY.fold_in,
    name="threefry2x32_written_out",
    tag="fry_out",
)
