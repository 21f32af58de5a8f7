"""Checks of numbers, counts and arrays that a user gives.  Imports no JAX, so help loads none."""

import math
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.contract.errors import Argument, InputError

#: Largest count: indices are int32.
MOST = 2**31 - 1
#: Largest number in single precision.
LARGEST = float(np.finfo(np.float32).max)
#: Smallest number above 0 in single precision.
TINY = float(np.finfo(np.float32).tiny)


def with_nan(value: Any) -> Any:
    """Return the array of a series, a table or a masked array, NaN where an entry is missing.

    Other values are returned unchanged.  Integers become floats only if one is missing.
    """
    if hasattr(value, "to_numpy"):
        array = value.to_numpy()
        if array.dtype == object and all(kind.kind in "fiub" for kind in np.ravel(value.dtypes)):
            return value.to_numpy(dtype=float, na_value=np.nan)  # columns of several kinds
        return array
    if isinstance(value, np.ma.MaskedArray):
        if not np.ma.is_masked(value):
            return value.data
        return np.ma.filled(value.astype(np.result_type(value.dtype, np.float32)), np.nan)
    return np.nan if type(value).__name__ == "NAType" else value  # of pandas


def check_whole(name: str, value: object, least: int = 1, most: int = MOST) -> None:
    """Refuse a ``value`` of the argument ``name`` that is not a whole number in these bounds.

    A traced value passes.
    """
    if _is_traced(value):
        return
    number = np.asarray(value)
    if number.ndim or number.dtype.kind not in "iu" or not least <= number <= most:
        shown = Argument(name, _shown(value))
        raise InputError(shown, f" must be a whole number from {least} to {most}.")


def check_number(
    name: str,
    value: object,
    *,
    above: float = -np.inf,
    least: float = -np.inf,
    below: float = np.inf,
    most: float = np.inf,
) -> None:
    """Refuse a ``value`` of the argument ``name`` with a number that is not finite, or outside.

    The value is a number or an array; a traced one passes.
    """
    if _is_traced(value):
        return
    try:
        numbers = np.asarray(value, float)
    except (TypeError, ValueError):  # a text in a file
        numbers = np.asarray(np.nan)
    inside = (numbers > above) & (numbers >= least) & (numbers < below) & (numbers <= most)
    if not (np.isfinite(numbers) & inside).all():
        noun = "finite numbers" if numbers.ndim else "a finite number"
        bounds = bounds_in_words(above, least, below, most)
        raise InputError(f"{name}={_shown(value)} must be {noun}{bounds}.")


def bounds_in_words(
    above: float = -np.inf, least: float = -np.inf, below: float = np.inf, most: float = np.inf
) -> str:
    """Bounds as they follow a noun in a message, such as " from 0 to 1"; "" if there are none."""
    if np.isfinite([least, most]).all():
        return f" from {plain(least)} to {plain(most)}"
    bounds = (("above", above), ("of at least", least), ("below", below), ("at most", most))
    return " and".join(f" {word} {plain(bound)}" for word, bound in bounds if np.isfinite(bound))


def plain(value: object) -> str:
    """Format a value as a user types it: no trailing ".0", lists with commas."""
    if isinstance(value, list | tuple):
        return ",".join(map(plain, value)) or "none"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{name}: {plain(entry)}' for name, entry in value.items())}}}"
    if isinstance(value, float):
        text = f"{value:g}"
        return text if float(text) == value or math.isnan(value) else repr(value)
    return "nothing" if value is None else str(value)


def _shown(value: object) -> str:
    return " ".join(repr(value).split())[:60]


def _is_traced(value: object) -> bool:
    if isinstance(value, list | tuple):
        return any(map(_is_traced, value))
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(value, jax.core.Tracer)
