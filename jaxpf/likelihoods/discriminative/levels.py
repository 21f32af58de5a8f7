"""A frame shrunk so that objects of any size are about equally large in it, all in one picture.

Features of appearance are taken where an object has some 18 to 36 pixels: finer detail does not
last from frame to frame, and tables over small pictures are small.  The sizes that P objects need
stand one below the other, so that one table serves all of them.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

#: An object is shrunk by 1, 2, 4, ... until the root of its area is at most this, pixels.
LARGEST_SIDE = 36.0


class Level(NamedTuple):
    """The part of the picture that shows the frame shrunk by a factor.

    Attributes:
        factor: pixels of the frame per pixel, both ways.
        first_row: where it begins.
        rows: its height.
        columns: its width; it begins at column 0.
    """

    factor: int
    first_row: int
    rows: int
    columns: int


def factor_of(width: float, height: float) -> int:
    """By how much to shrink an object of that size, pixels: a power of two."""
    side = math.sqrt(width * height) / LARGEST_SIDE
    return 2 ** max(math.ceil(math.log2(side)), 0)


def levels_of(factors: Sequence[int], frame_shape: tuple[int, int]) -> list[Level]:
    """The levels of a picture, one below the other.

    Args:
        factors: of the levels, each once.
        frame_shape: height and width of the frame.
    """
    found: list[Level] = []
    for factor in factors:
        first = found[-1].first_row + found[-1].rows if found else 0
        rows, columns = (-(-size // factor) for size in frame_shape)
        found.append(Level(factor, first, rows, columns))
    return found


def shrunk(frame: jax.Array, factor: int) -> jax.Array:
    """Means of ``factor x factor`` pixels, float32 [h, w, 3] on the scale 0 to 255.

    Beyond the frame its last row and column go on.

    Args:
        frame: uint8 [H, W, 3].
        factor: 1 or more.
    """
    height, width = frame.shape[:2]
    if factor == 1:
        return frame.astype(jnp.float32)
    padding = (-height % factor, -width % factor)
    if any(padding):
        frame = jnp.pad(frame, ((0, padding[0]), (0, padding[1]), (0, 0)), mode="edge")
    rows = frame.reshape(-1, factor, frame.shape[1] * 3).astype(jnp.int32).sum(axis=1)
    sums = rows.reshape(len(rows), -1, factor, 3).sum(axis=2)
    return sums.astype(jnp.float32) / np.float32(factor**2)


def stacked(pictures: Sequence[jax.Array], fill: int) -> jax.Array:
    """Pictures one below the other, narrow ones filled up at the right."""
    width = max(picture.shape[1] for picture in pictures)

    def widened(picture):
        padding = [(0, 0), (0, width - picture.shape[1]), *[(0, 0)] * (picture.ndim - 2)]
        return jnp.pad(picture, padding, constant_values=fill)

    return jnp.concatenate([widened(picture) for picture in pictures])
