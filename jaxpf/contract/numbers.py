"""Checks of numbers, counts and arrays that a user gives.  Imports no JAX, so help loads none."""

import math
import re
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import Argument, InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: Largest count: indices are int32.
MOST = 2**31 - 1
#: Smallest number above 0 in single precision.
TINY = float(np.finfo(np.float32).tiny)
#: Lower bound of an array that need only be finite.
FINITE = -float(np.finfo(np.float64).max)
#: Kinds of arrays that do not hold real numbers: objects, texts, times, complex numbers.
_NO_NUMBERS = "OSUTMmc"


def check_array(
    name: str, value: Any, wanted: str, least: float = -np.inf, most: float = np.inf
) -> None:
    """Refuse a value, traced or not, that is not an array of real numbers of the wanted shape.

    With a bound, numbers that are not traced must be finite, too, and in the bounds.

    Args:
        name: of the argument.
        value: of the argument.
        wanted: what to give, with its shape in brackets, such as "x, y in pixels, [P, 2]" or
            "[..., >= 3]": numbers are sizes, and names stand for any size.
        least: smallest number.
        most: largest number.

    Raises:
        InputError: names the shape, or the value if it has none, and what is ``wanted``.
    """
    try:
        shape = np.shape(value)
        dtype = getattr(value, "dtype", None)
        kind = (np.asarray(value).dtype if dtype is None else dtype).kind
    except (TypeError, ValueError):  # rows of different lengths, or a list of traced numbers
        if _is_traced(value):
            return
        shape, kind = (), "O"
    bracketed = re.search(r"\[(.*?)\]", wanted)
    axes = bracketed[1].split(", ") if bracketed else ["..."]
    axes = [] if axes == [""] else axes
    ends = shape
    if axes[:1] == ["..."]:
        axes = axes[1:]
        ends = shape[max(len(shape) - len(axes), 0) :]
    fits = len(ends) == len(axes) and all(map(_is_size, axes, ends))
    if not fits or kind in _NO_NUMBERS:
        is_array = shape and kind not in _NO_NUMBERS
        given = f" has shape {list(shape)}; give" if is_array else f"={_shown(value)} must be"
        raise InputError(f"{name}{given} {wanted.replace('[>= 1', '[N')}.")
    if isinstance(value, int) and abs(value) > MOST:
        raise InputError(f"{name}={_shown(value)} is too large; write it as {float(value):g}.")
    if np.isfinite([least, most]).any() and not _is_traced(value):
        numbers = np.asarray(value).astype(float)
        if not (np.isfinite(numbers) & (numbers >= least) & (numbers <= most)).all():
            raise InputError(f"{name}={_shown(value)} must be {wanted}.")


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


def coordinates_in(name: str, value: object) -> tuple[int, ...]:
    """Convert indices of coordinates to a tuple; refuse what is not a list of whole numbers."""
    wanted = "whole numbers, the coordinates of a substate counted from 0, [n]"
    numbers = numbers_in(name, value, wanted)
    if (numbers != np.round(numbers)).any():
        raise InputError(f"{name}={_shown(value)} must be {wanted}.")
    return tuple(int(number) for number in numbers)


def numbers_in(
    name: str, value: Any, wanted: str, least: float = -np.inf, most: float = np.inf
) -> np.ndarray:
    """Convert the concrete ``value`` of the argument ``name`` to float64; see ``check_array``."""
    value = with_nan(value)
    check_array(name, value, wanted, least, most)
    return np.asarray(value).astype(float)


def check_whole(name: str, value: object, least: int = 1, most: int = MOST) -> None:
    """Refuse a ``value`` of the argument ``name`` that is not a whole number in these bounds.

    A traced value passes.
    """
    if _is_traced(value):
        return
    try:
        number = np.asarray(value)
    except ValueError:  # rows of different lengths
        number = np.asarray(None)
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
    """Refuse a ``value`` of the argument ``name`` that is not one finite number in these bounds.

    A traced value passes.
    """
    if _is_traced(value):
        return
    wanted = f"a finite number{bounds_in_words(above, least, below, most)}"
    number = numbers_in(name, value, wanted)
    is_one = number.ndim == 0 and np.isfinite(number)
    if not (is_one and above < number < below and least <= number <= most):
        raise InputError(f"{name}={_shown(value)} must be {wanted}.")


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


def returned(
    value: Any, shape: Sequence[int | None] | None, function: str, wanted: str = ""
) -> Any:
    """Return what a user's function returned; refuse all but real numbers of the wanted shape.

    Args:
        value: traced or not.
        shape: sizes, of which None is any; None for any shape.
        function: its name.
        wanted: what to return; default the shape.
    """
    is_number = hasattr(value, "shape") or isinstance(value, int | float | complex)
    found, sizes = np.shape(value) if is_number else (), shape or ()
    fits = shape is None or (
        len(found) == len(sizes)
        and all(want in (None, size) for want, size in zip(sizes, found, strict=True))
    )
    what = f"shape {list(found)}"
    if not is_number:
        what = "nothing" if value is None else type(value).__name__
    elif getattr(value, "dtype", np.result_type(type(value))).kind == "c":
        what, wanted = "complex numbers", "real ones"
    elif fits:
        return value
    raise InputError(f"{function} returns {what}; return {wanted or list(sizes)}.")


def check_together(**arrays: "ArrayLike") -> None:
    """Refuse arrays, by the names of their arguments, whose shapes do not broadcast.

    Raises:
        InputError: see ``check_array``, or names the shapes.
    """
    for name, values in arrays.items():
        check_array(name, values, "numbers of one shape")
    shapes = {name: np.shape(values) for name, values in arrays.items()}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        given = " and ".join(f"{name} {list(shape)}" for name, shape in shapes.items())
        raise InputError(
            f"the shapes of {given} do not go together; give arrays of one shape, or axes of 1."
        ) from None


def _is_size(axis: str, size: int) -> bool:
    if axis.startswith(">= "):
        return size >= int(axis[3:])
    return not axis.isdigit() or size == int(axis)


def _shown(value: object) -> str:
    return " ".join(repr(value).split())[:60]


def _is_traced(value: object) -> bool:
    if isinstance(value, list | tuple):
        return any(map(_is_traced, value))
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(value, jax.core.Tracer)
