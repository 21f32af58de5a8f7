"""Argument checks shared by the image likelihoods."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from jaxpf.contract.errors import InputError, check_names
from jaxpf.contract.numbers import FINITE, numbers_in
from jaxpf.likelihoods.color import check_frame

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

#: What ``boxes`` are, in messages.
BOXES = "finite x, y, w, h in pixels of every object, [>= 1, 4]"
#: Lower bound of the mean, of 255, by which a window is divided: noise on black must not look like
#: contrast.
DARKEST_MEAN = 1.0
#: Largest number of columns or rows of a window.
_WIDEST = 1000
#: How colours are read at positions between pixels.
INTERPOLATIONS = ("nearest", "bilinear")


def check_window(window: object, example: str, name: str = "window") -> None:
    """Reject a grid that is not two whole numbers from 1, columns and rows."""
    sides = window if isinstance(window, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(n, int) and 1 <= n <= _WIDEST for n in sides):
        raise InputError(f"{name} is {window!r}: give the two sides of a grid, such as {example}.")


def shown_as(name: str, count: int, names: Sequence[str] | None = None) -> list[str]:
    """How messages show each of ``count`` objects: by ``names``, or as entries of an argument."""
    if names is None:
        return [f"{name}[{i}]" for i in range(count)]
    check_names(names, count)
    return list(names)


def checked_sizes(
    name: str, sizes: "ArrayLike", count: int, bands: int = 1, names: Sequence[str] | None = None
) -> np.ndarray:
    """Convert widths and heights ``[count, 2]``; refuse those below one pixel, or one per band."""
    wanted = f"finite width and height of every object, [{count}, 2]"
    sizes = numbers_in(name, sizes, wanted, FINITE)
    for shown, (width, height) in zip(shown_as(name, count, names), sizes, strict=True):
        if width < 1 or height < bands:
            raise InputError(
                f"{shown} is {width:g} pixels wide and {height:g} high: use at least 1 pixel "
                f"of width and {bands} of height."
            )
    return sizes


def check_not_black(windows: np.ndarray, names: Sequence[str]) -> None:
    """Refuse windows ``[N, ...]`` that are too dark to be divided by their mean."""
    for name, mean in zip(names, windows.mean(axis=(1, 2)), strict=True):
        if mean < DARKEST_MEAN:
            raise InputError(
                f"{name} is black, its mean {mean:.2g} of 255, so nothing can be divided by it: "
                "move or enlarge it."
            )


def check_coordinates(
    substates: "jax.Array", owner: str, wanted: str, least: int, most: int | None = None
) -> None:
    """Refuse substates ``[D, N]`` whose D is not from ``least`` to ``most``; default any above."""
    length = substates.shape[0]
    if length < least or (most is not None and length > most):
        raise InputError(f"a substate has {length} values: {owner} takes {wanted}.")


def check_pictures(name: str, pictures: Sequence[np.ndarray]) -> None:
    """Refuse what is not a list of pictures, uint8 RGB ``[h, w, 3]``."""
    if not hasattr(pictures, "__len__") or len(pictures) == 0:
        raise InputError(f"{name}={pictures!r:.60} must be a list with a picture of every object.")
    for i, picture in enumerate(pictures):
        check_frame(picture, f"{name}[{i}]")


def points_in(points: "ArrayLike", frame_shape: tuple[int, int]) -> np.ndarray:
    """Convert points ``[P, 2]`` to float32; refuse those outside the frame."""
    points = numbers_in("points", points, "x, y in pixels of every point, [>= 1, 2]")
    points = points.astype(np.float32)
    height, width = frame_shape
    for i, (x, y) in enumerate(points):
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f"point {i} is at ({x:g}, {y:g}), outside the frame of {width} x {height} pixels: "
                "move it inside, or leave it out."
            )
    return points
