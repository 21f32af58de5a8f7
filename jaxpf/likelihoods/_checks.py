"""Argument checks shared by the image likelihoods."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError, check_names
from jaxpf.contract.numbers import numbers_in
from jaxpf.likelihoods.color import check_frame

#: Largest number of columns or rows of a window.
_WIDEST = 1000
#: How colours are read at positions between pixels.
INTERPOLATIONS = ("nearest", "bilinear")


def shown_as(name: str, count: int, names: Sequence[str] | None = None) -> list[str]:
    """How messages show each of ``count`` objects: by ``names``, or as entries of an argument."""
    if names is None:
        return [f"{name}[{i}]" for i in range(count)]
    check_names(names, count)
    return list(names)


def check_window(window: Any, example: str, name: str = "window") -> None:
    """Reject a grid that is not two whole numbers from 1, columns and rows."""
    sides = window if isinstance(window, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(n, int) and 1 <= n <= _WIDEST for n in sides):
        raise InputError(f"{name} is {window!r}: give the two sides of a grid, such as {example}.")


def window_sizes(sizes: Any, count: int, names: Sequence[str] | None = None) -> np.ndarray:
    """Convert widths and heights ``[count, 2]``; refuse those below one pixel."""
    sizes = numbers_in("sizes", sizes, f"width and height of all objects, [{count}, 2]")
    sizes = sizes.astype(np.float32)
    for name, (width, height) in zip(shown_as("sizes", count, names), sizes, strict=True):
        if not (math.isfinite(width * height) and width >= 1 and height >= 1):
            raise InputError(f"{name} is {width:g} x {height:g} pixels: use at least 1 of each.")
    return sizes


def check_pictures(name: str, pictures: Any) -> None:
    """Refuse what is no list of pictures, uint8 RGB ``[h, w, 3]``."""
    if not hasattr(pictures, "__len__") or len(pictures) == 0:
        raise InputError(f"{name}={pictures!r:.60} must be a list with a picture of every object.")
    for i, picture in enumerate(pictures):
        check_frame(picture, f"{name}[{i}]")
