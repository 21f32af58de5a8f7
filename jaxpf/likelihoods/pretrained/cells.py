"""Means of a network's maps in the cells of boxes.

A feature is a channel's mean over a cell, divided by the square root of the number of cells and
channels.  Maps keep their sign, unlike histograms: no root is taken.  A cell edge between two
places of a map counts the place by its share; outside the window maps are zero, the mean.
"""

import math

import jax
import jax.numpy as jnp

from jaxpf.likelihoods._places import line_before
from jaxpf.lowering.columns import entries_at


def cell_features(maps: jax.Array, boxes: jax.Array, grid: tuple[int, int]) -> jax.Array:
    """Features of boxes, [N, rows, columns, C].

    Args:
        maps: [h, w, C].
        boxes: [N, 4], left, top, width and height, in places of the map.
        grid: rows and columns of cells.
    """
    height, width, channels = maps.shape
    left, top, across, down = boxes.T
    sums = jnp.einsum(
        "ngh,hwc,nkw->ngkc", _shares(top, down, grid[0], height), maps,
        _shares(left, across, grid[1], width), precision="highest",
    )  # fmt: skip
    return sums / math.sqrt(grid[0] * grid[1] * channels)


def _shares(first: jax.Array, extent: jax.Array, count: int, length: int) -> jax.Array:
    """The weight of each of ``length`` lines in the mean of each of ``count`` cells of a box."""
    edges = first[:, None] + extent[:, None] * (jnp.arange(count + 1) / count)
    lines = jnp.arange(length)
    last = jnp.minimum(edges[:, 1:, None], lines + 1)
    shared = jnp.maximum(last - jnp.maximum(edges[:, :-1, None], lines), 0)
    return shared / (extent[:, None, None] / count)


def score_table(maps: jax.Array, weights: jax.Array) -> jax.Array:
    """Integral table of each cell's part of the score, [h + 1, w + 1, rows * columns].

    ``score_in_boxes`` of it is ``sum(cell_features * weights)``.

    Args:
        maps: [h, w, C].
        weights: [rows, columns, C].
    """
    scaled = weights.reshape(-1, weights.shape[-1]) / math.sqrt(weights.size)
    parts = jnp.matmul(maps, scaled.T, precision="highest")
    return jnp.pad(parts.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0), (0, 0)))


def score_in_boxes(
    tables: jax.Array, partition: jax.Array, boxes: jax.Array, grid: tuple[int, int]
) -> jax.Array:
    """Scores [N] of boxes.

    Args:
        tables: of P objects, [P, h + 1, w + 1, rows * columns].
        partition: int [N], each box's object.
        boxes: [4, N], left, top, width and height, in places of the maps.
        grid: rows and columns of cells.
    """
    height, width, cells = tables.shape[1] - 1, tables.shape[2] - 1, tables.shape[3]
    flat = tables.reshape(-1)
    cell = jnp.arange(cells).reshape(*grid, 1)
    left, top, across, down = boxes

    def lines(first, extent, count, length):
        """Cell edges within the map."""
        edges = first + extent * (jnp.arange(count + 1)[:, None] / count).astype(first.dtype)
        return line_before(edges, length)

    rows, below = lines(top, down, grid[0], height)
    columns, beyond = lines(left, across, grid[1], width)

    def corners(lower, right):
        """The tables at one corner of every cell, by linear interpolation: [rows, columns, N]."""
        own_rows, own_columns = slice(lower, lower + grid[0]), slice(right, right + grid[1])
        row, column = rows[own_rows, None], columns[None, own_columns]
        place = ((partition * (height + 1) + row) * (width + 1) + column) * cells + cell
        at = [entries_at(flat, place + k * cells) for k in (0, 1, width + 1, width + 2)]
        share = beyond[None, own_columns]
        above, under = (at[k] + share * (at[k + 1] - at[k]) for k in (0, 2))
        return above + below[own_rows, None] * (under - above)

    sums = corners(1, 1) - corners(1, 0) - corners(0, 1) + corners(0, 0)
    area = jnp.maximum(across * down, 1e-6) / cells
    return jnp.sum(sums, axis=(0, 1)) / area
