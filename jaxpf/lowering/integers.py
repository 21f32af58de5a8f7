"""Whole numbers divided and put in order, vectorised."""

import jax
import jax.numpy as jnp
from jax import lax

#: Whole numbers up to it are exact in float32.
EXACT = 2**24


def modulo(number: jax.Array, divisor: jax.Array) -> jax.Array:
    """``number % divisor`` of positive integers up to ``EXACT``, vectorised as no division is."""
    quotient = jnp.floor(number.astype(jnp.float32) / divisor.astype(jnp.float32))
    rest = number - quotient.astype(jnp.int32) * divisor
    rest = jnp.where(rest < 0, rest + divisor, rest)
    return jnp.where(rest >= divisor, rest - divisor, rest)


def order_by_group(group: jax.Array) -> jax.Array:
    """``[N]`` int32: particles in order of their group ``[N]`` (0..N-1), stably."""
    num_particles = group.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    if num_particles <= 2**16:
        # One integer key holds group and index: a plain sort, several times faster than
        # one that carries a second operand.
        key = group.astype(jnp.uint32) * jnp.uint32(num_particles) + identity.astype(jnp.uint32)
        return (lax.sort(key) % jnp.uint32(num_particles)).astype(jnp.int32)
    return lax.sort((group, identity), num_keys=1, is_stable=True)[1]
