"""Shrunken copies of a frame, and their brightness gradients, to be summed in the cells of a box.

Appearance features are computed where an object has about 18 to 36 pixels: finer detail does not
persist from frame to frame, and tables of small pictures are small.  The levels that P objects need
are stacked vertically, so that one table serves all of them.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.lowering.columns import entries_at

#: An object is shrunk by 1, 2, 4, ... until the square root of its area is at most this, pixels.
LARGEST_SIDE = 36.0
#: Number of directions of the brightness gradient, over the full circle.
ORIENTATIONS = 8
_LUMA = (0.299, 0.587, 0.114)


def factor_of(width: float, height: float) -> int:
    """The factor by which to shrink an object of this size in pixels, a power of two."""
    side = math.sqrt(width * height) / LARGEST_SIDE
    return 2 ** max(math.ceil(math.log2(side)), 0)


def regions_of(factors: Sequence[int], frame_shape: tuple[int, int]) -> np.ndarray:
    """Where each level lies in the picture: its first row, height and width, int [L, 3].

    Levels begin at column 0.

    Args:
        factors: of the levels, from top to bottom.
        frame_shape: height and width of the frame.
    """
    sizes = np.array([size_of(frame_shape, factor) for factor in factors])
    return np.column_stack([np.cumsum(sizes[:, 0]) - sizes[:, 0], sizes])


def size_of(frame_shape: tuple[int, int], factor: int) -> tuple[int, int]:
    """Height and width of a frame shrunk by a factor."""
    return -(-frame_shape[0] // factor), -(-frame_shape[1] // factor)


def shrunk(frame: jax.Array, factor: int) -> jax.Array:
    """Means of ``factor x factor`` pixels, float32 [h, w, 3] on the scale 0 to 255.

    The last row and column of the frame are repeated to fill the last blocks.

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


def shrunk_part(frame: jax.Array, factor: int, rows: np.ndarray, columns: np.ndarray) -> jax.Array:
    """Some rows and columns of ``shrunk(frame, factor)``, computed from their pixels alone.

    Args:
        frame: uint8 [H, W, 3].
        factor: 1 or more.
        rows: int [h]; rows outside the shrunken frame repeat its first or last one.
        columns: int [w], likewise.
    """

    def lines(places, size, shrunk_size):
        places = jnp.clip(places, 0, shrunk_size - 1)[:, None] * factor
        return jnp.minimum(places + np.arange(factor), size - 1).ravel()

    height, width = frame.shape[:2]
    num_rows, num_columns = size_of((height, width), factor)
    part = entries_at(frame, lines(rows, height, num_rows))
    return shrunk(part[:, lines(columns, width, num_columns)], factor)


def stacked(pictures: Sequence[jax.Array], fill: int) -> jax.Array:
    """Pictures stacked vertically, padded on the right to the same width."""
    width = max(picture.shape[1] for picture in pictures)

    def widened(picture):
        padding = [(0, 0), (0, width - picture.shape[1]), *[(0, 0)] * (picture.ndim - 2)]
        return jnp.pad(picture, padding, constant_values=fill)

    return jnp.concatenate([widened(picture) for picture in pictures])


def gradients(picture: jax.Array) -> jax.Array:
    """Strength of the brightness gradient in each of eight directions (Dalal and Triggs 2005).

    A pixel's vote is the square root of the gradient's length, shared between the two nearest
    directions.

    Args:
        picture: float [h, w, 3], red, green, blue, 0 to 1.

    Returns:
        [h, w, 8], 0 to 1.
    """
    grey = picture @ jnp.asarray(_LUMA, picture.dtype)
    padded = jnp.pad(grey, 1, mode="edge")
    across = (padded[1:-1, 2:] - padded[1:-1, :-2]) / 2
    down = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / 2
    length = jnp.sqrt(across**2 + down**2)
    turn = jnp.arctan2(down, across) * (ORIENTATIONS / (2 * jnp.pi))
    away = (turn[..., None] - jnp.arange(ORIENTATIONS) + ORIENTATIONS / 2) % ORIENTATIONS
    share = jnp.maximum(1 - jnp.abs(away - ORIENTATIONS / 2), 0)
    return jnp.sqrt(length)[..., None] * share
