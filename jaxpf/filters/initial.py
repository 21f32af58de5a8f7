"""The initial state, for every filter."""

from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array, is_concrete


def checked_initial(initial: Any, may_be_empty: bool = False) -> Any:
    """Convert a user's initial state to an array of floats; return a sampler unchanged.

    With ``may_be_empty``, a row of NaN is an empty slot.
    """
    if callable(initial):
        return initial
    if is_concrete(initial):
        is_wrong = ~np.isfinite(np.asarray(initial))
        if may_be_empty:
            is_wrong &= ~is_wrong.all(axis=-1, keepdims=True)
        if is_wrong.any():
            raise InputError(
                f"initial holds {is_wrong.sum()} value(s) that are not finite, the first at "
                f"{np.argwhere(is_wrong)[0].tolist()}; give finite numbers."
            )
    return as_floats(as_array(initial))


def initial_rows(initial: Any, count: int | None = None, may_be_empty: bool = False) -> Any:
    """``checked_initial``, and refuse an array that is not ``[P, D]``, or has not P = ``count``."""
    initial = checked_initial(initial, may_be_empty)
    if not callable(initial):
        shape = initial.shape
        if len(shape) != 2 or 0 in shape or count not in (None, shape[0]):
            raise InputError(
                f"initial has shape {list(shape)}; give [{count or 'P'}, D], a row for each "
                "partition, or a sampler key -> [P, D]."
            )
    return initial


def count_partitions(initial: Any) -> int:
    """Number of partitions, P, of an initial state."""
    if not callable(initial):
        return initial.shape[0]
    return jax.eval_shape(initial, jax.random.key(0)).shape[0]


def draw_initial(initial: Any, key: jax.Array, num_particles: int) -> jax.Array:
    """Particles ``[D, P, N]`` of an initial state."""
    if not callable(initial):
        return jnp.repeat(initial.T[..., None], num_particles, axis=-1)
    drawn = jax.vmap(initial)(jax.random.split(key, num_particles))
    chex.assert_rank(drawn, 3)
    return jnp.moveaxis(as_floats(drawn), (0, 1, 2), (2, 1, 0))


def check_rows(dynamics: Any, num_partitions: int) -> None:
    """Refuse fields with a row for each partition that have another number of rows.

    JAX would repeat the last row.
    """
    for name in optional(dynamics, "by_partition"):
        rows = np.shape(getattr(dynamics, name))
        if len(rows) > 1 and rows[0] not in (1, num_partitions):
            raise InputError(
                f"{type(dynamics).__name__}.{name} has shape {list(rows)}, but there are "
                f"{num_partitions} partitions; give a row for each, or one for all."
            )


def as_floats(values: jax.Array) -> jax.Array:
    """Convert whole numbers, and half precision, which cannot separate particles, to floats."""
    is_float = jnp.issubdtype(values.dtype, jnp.floating)
    return values.astype(jnp.promote_types(values.dtype, jnp.float32) if is_float else float)
