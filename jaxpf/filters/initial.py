"""Checks of the initial state, for every filter."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array, is_concrete


def checked_initial(initial: Any, may_be_empty: bool = False) -> Any:
    """Convert a user's initial state to an array of floats; return a sampler unchanged.

    With ``may_be_empty``, a row of NaN is an empty slot.
    """
    if callable(initial):
        return initial
    if is_concrete(initial):
        _check(initial, may_be_empty)
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


def as_floats(values: jax.Array) -> jax.Array:
    """Convert whole numbers, and half precision, which cannot separate particles, to floats."""
    is_float = jnp.issubdtype(values.dtype, jnp.floating)
    return values.astype(jnp.promote_types(values.dtype, jnp.float32) if is_float else float)


def _check(initial: object, may_be_empty: bool) -> None:
    try:
        values = np.asarray(initial)
    except ValueError:  # rows of different lengths
        values = np.asarray(None)
    if values.dtype.kind not in "iuf":
        kind = {"c": "complex numbers", "b": "truth values"}.get(values.dtype.kind)
        what = f"holds {kind}" if kind else f"is {type(initial).__name__}, not an array of numbers"
        raise InputError(f"initial {what}; give real numbers, or a sampler key -> [P, D].")
    values = np.asarray(values, float)
    is_wrong = ~np.isfinite(values)
    if may_be_empty and values.ndim:
        is_wrong &= ~np.isnan(values).all(axis=-1, keepdims=True)
    wrong = np.argwhere(is_wrong)
    if len(wrong):
        raise InputError(
            f"initial holds {len(wrong)} value(s) that are not finite, the first at "
            f"{wrong[0].tolist()}; give finite numbers."
        )
