"""Derivatives taken from another value, and products with finite derivatives."""

import jax
import jax.numpy as jnp


@jax.custom_jvp
def with_gradient_of(value: jax.Array, source: jax.Array) -> jax.Array:
    """Return ``value`` and add the derivative of ``source``, of the same shape, to its own.

    Equivalent to ``value + (source - stop_gradient(source))``, but costs nothing in the forward
    pass and works if ``source`` is -inf.
    """
    return value


@with_gradient_of.defjvp
def _with_gradient_of_jvp(primals, tangents):
    return primals[0], tangents[0] + tangents[1]


def weighted(share: jax.Array, log_weights: jax.Array) -> jax.Array:
    """``share * log_weights``, and 0 where ``share`` is 0."""
    return share * jnp.where(share > 0, log_weights, 0.0)
