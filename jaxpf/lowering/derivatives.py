"""Derivatives that are lent to a value, and none that is NaN."""

import jax
import jax.numpy as jnp


@jax.custom_jvp
def with_gradient_of(value: jax.Array, source: jax.Array) -> jax.Array:
    """``value``, which ``source`` of the same shape gives its own derivative on top.

    The same as ``value + (source - stop_gradient(source))``, but the forward pass computes
    nothing of it, and a ``source`` that is -inf does no harm.
    """
    return value


@with_gradient_of.defjvp
def _with_gradient_of_jvp(primals, tangents):
    return primals[0], tangents[0] + tangents[1]


def weighted(share: jax.Array, log_weights: jax.Array) -> jax.Array:
    """``share * log_weights``, and 0 where the share is."""
    return share * jnp.where(share > 0, log_weights, 0.0)
