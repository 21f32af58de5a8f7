"""Refusals of boxes, windows and points from which nothing can be learned."""

from collections.abc import Sequence

import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole

#: Largest number of columns or rows of a grid.
_WIDEST = 1000


def check_window(name: str, sides: tuple[int, int]) -> None:
    """Refuse a window or grid whose sides are not from 1 to 1000."""
    for side in sides:
        check_whole(name, side, most=_WIDEST)


def shown_as(name: str, count: int, names: Sequence[str] | None = None) -> list[str]:
    """How messages show each of ``count`` objects: by ``names``, or as entries of an argument."""
    return [f"{name}[{i}]" for i in range(count)] if names is None else list(names)


def sizes_in(sizes: ArrayLike, names: Sequence[str], bands: int = 1) -> np.ndarray:
    """Convert widths and heights ``[P, 2]``; refuse those below one pixel, or one per band."""
    sizes = np.asarray(sizes, float)
    for name, (width, height) in zip(names, sizes, strict=True):
        if not (1 <= width < np.inf and bands <= height < np.inf):
            raise InputError(
                f"{name} is {width:g} pixels wide and {height:g} high: use at least 1 pixel "
                f"of width and {bands} of height."
            )
    return sizes


def points_in(points: ArrayLike, frame_shape: tuple[int, int]) -> np.ndarray:
    """Convert points ``[P, 2]`` to float32; refuse those outside the frame."""
    points = np.asarray(points, np.float32)
    height, width = frame_shape
    for i, (x, y) in enumerate(points):
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f"point {i} is at ({x:g}, {y:g}), outside the frame of {width} x {height} pixels: "
                "move it inside, or leave it out."
            )
    return points
