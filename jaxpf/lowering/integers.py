"""Vectorised division and sorting of integers."""

import jax
import jax.numpy as jnp
from jax import lax

#: Integers up to this value are exact in float32.
EXACT = 2**24


def modulo(number: jax.Array, divisor: jax.Array) -> jax.Array:
    """``number % divisor`` of positive integers up to ``EXACT``, vectorised unlike division."""
    quotient = jnp.floor(number.astype(jnp.float32) / divisor.astype(jnp.float32))
    rest = number - quotient.astype(jnp.int32) * divisor
    rest = jnp.where(rest < 0, rest + divisor, rest)
    return jnp.where(rest >= divisor, rest - divisor, rest)


def order_by_group(group: jax.Array) -> jax.Array:
    """``[N]`` int32: stable sort of the particles by their group ``[N]`` (0..N-1)."""
    num_particles = group.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    if num_particles <= 2**16:
        # One integer key holds group and index: a plain sort is several times faster than one
        # with a second operand.
        key = group.astype(jnp.uint32) * jnp.uint32(num_particles) + identity.astype(jnp.uint32)
        return (lax.sort(key) % jnp.uint32(num_particles)).astype(jnp.int32)
    return lax.sort((group, identity), num_keys=1, is_stable=True)[1]
