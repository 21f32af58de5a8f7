"""Means of the values that count, in JAX."""

from collections.abc import Sequence

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def masked_mean(values: ArrayLike, mask: ArrayLike, axis: int | Sequence[int]) -> Array:
    """Mean of the finite values where ``mask`` is true; NaN if there are none."""
    values = as_float(values)
    axis = axis if isinstance(axis, int) else tuple(axis)
    counts = jnp.isfinite(values) & jnp.asarray(mask, bool)
    total = jnp.sum(jnp.where(counts, values, 0), axis)
    number = jnp.sum(counts, axis)
    return jnp.where(number > 0, total / jnp.maximum(number, 1), jnp.nan)


def as_float(values: ArrayLike) -> Array:
    """Convert to a float array; integers and bools become the default float."""
    values = jnp.asarray(float(values) if isinstance(values, int) else values)
    return values.astype(jnp.result_type(values.dtype, jnp.float32))
