"""Learned appearance computed only near boxes, for small objects in large frames.

Integral tables of a whole frame serve any box, but most of a large frame contains none.  Here two
smaller pictures are cut from the shrunken frame:

- *windows* of one fixed shape around the objects' last estimates, for the particles: their tables
  are those of the whole frame, up to constants that cancel;
- *tiles* around the grid of places elsewhere, for the log odds: too few boxes for a table, so each
  sums its own pixels.

A score is a function of the same integers as with the whole frame, and equal up to rounding.  A
box that its window does not contain, or that has outgrown the tiles, scores NaN, and the filter
repeats the step with the whole frame.  So every likelihood that counts is the one given the whole
frame: windows change the time, not the model, and evidence remains the density of the whole frame.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.likelihoods._integral import Boxes, least_sum, line_at, parts, whole_values
from jaxpf.likelihoods.discriminative.pictures import gradients, shrunk_part, size_of

#: Rows and columns of the grid of places elsewhere in the frame.
PLACES = 12
#: An object that grows by more than this needs whole frames.
_GROWTH = 1.5
#: Pixels next to a box on which its features depend.
_MARGIN = 1
#: Windows must cost at most this share of the whole frame: they compile the step twice.
_LARGEST_SHARE = 0.5
#: Cost of a pixel of a tile, relative to one with a table.
_TILE_COST = 0.3
#: Windows are rounded up to multiples of this, so that few shapes are compiled.
_STEP = 16


class WindowShape(NamedTuple):
    """The shape of every object's window, shrunk pixels.

    Attributes:
        rows: its height.
        columns: its width.
        height: of the largest box that is evaluated.
        width: of the largest box that is evaluated.
    """

    rows: int
    columns: int
    height: int
    width: int


class Nearby(NamedTuple):
    """The observation of the parts of a frame that boxes are evaluated in.

    Attributes:
        objects: tables of the objects' windows, stacked vertically.
        elsewhere: pixels around the places of the grid, one picture for each of L levels, of 12 x
            12 tiles, [L, 12 * h, 12 * w]: colour bins, int32; and gradients, integers in float32,
            with a last axis of 8 channels.
        corners: int32 [P, 2], first row and column of each window in its level.
    """

    objects: Any
    elsewhere: tuple[jax.Array, jax.Array]
    corners: jax.Array


def window_shape(likelihood: Any, reach: float) -> WindowShape | None:
    """The shape of windows; None if they save little, or with interpolation.

    Args:
        likelihood: with all its levels.
        reach: distance from a box to its window's edge, in square roots of the object's area.
    """
    if likelihood.interpolation != "nearest":
        return None
    factors = np.array(likelihood.factors)[np.asarray(likelihood.level)]
    sizes = _GROWTH * np.asarray(likelihood.sizes) / factors[:, None]
    width, height = (int(side) for side in np.ceil(sizes.max(axis=0)))
    beyond = reach * np.sqrt(sizes.prod(axis=1)).max() + _MARGIN + 1
    rows, columns = (int(-(-(side + 2 * beyond) // _STEP)) * _STEP for side in (height, width))
    shape = WindowShape(rows, columns, height, width)
    tiles = len(likelihood.factors) * PLACES**2 * np.prod(_tile_shape(shape))
    cost = len(sizes) * rows * columns + _TILE_COST * tiles
    whole = sum(np.prod(size_of(likelihood.frame_shape, factor)) for factor in likelihood.factors)
    return shape if cost <= _LARGEST_SHARE * whole else None


def observe(likelihood: Any, frame: jax.Array, estimates: jax.Array) -> Nearby:
    """Tables of windows around estimates, [P, D], and the pixels of tiles.

    The window of an estimate that is not finite contains no box.
    """
    frame, (rows, columns, *_) = jnp.asarray(frame), likelihood.windows
    shrinking = jnp.array(likelihood.factors, estimates.dtype)[likelihood.level, None]
    first = jnp.round(estimates[:, 1::-1] / shrinking) - np.array([rows, columns]) // 2
    corners = jnp.where(jnp.isfinite(first), first, -2 * max(rows, columns)).astype(jnp.int32)

    def window_of(factor: int) -> Callable:
        return lambda corner: shrunk_part(
            frame, factor, corner[0] + np.arange(rows), corner[1] + np.arange(columns)
        )

    cuts = [window_of(factor) for factor in likelihood.factors]
    windows = jax.lax.map(
        lambda of: jax.lax.switch(of[0], cuts, of[1]), (likelihood.level, corners)
    )
    tiles = []
    for factor, lines in zip(likelihood.factors, _tile_lines(likelihood), strict=True):
        picture = shrunk_part(frame, factor, *(of.ravel() for of in lines))
        values = whole_values(gradients(picture / 255)).astype(jnp.float32)
        tiles.append((likelihood.colour_bins(picture), values))
    objects = likelihood.seen_in([windows.reshape(-1, columns, 3)])
    return Nearby(objects, jax.tree.map(lambda *of: jnp.stack(of), *tiles), corners)


def in_windows(
    likelihood: Any, corners: jax.Array, partition: jax.Array, boxes: Boxes
) -> tuple[Boxes, jax.Array]:
    """Boxes of levels as boxes of windows, and bool [N], whether the windows contain them."""
    shape = likelihood.windows
    row, column = corners[partition].T
    inside = (boxes.width <= shape.width) & (boxes.height <= shape.height)
    for start, extent, size, first, length in (
        (boxes.top, boxes.height, boxes.rows, row, shape.rows),
        (boxes.left, boxes.width, boxes.columns, column, shape.columns),
    ):
        inside &= line_at(start, size) >= first + _MARGIN
        inside &= line_at(start + extent, size) <= first + length - _MARGIN
    return boxes._replace(first_row=partition * shape.rows - row, first_column=-column), inside


def scores_on_grid(likelihood: Any, tiles: Any, partition: jax.Array, boxes: Boxes) -> jax.Array:
    """Scores [N, 144] of N objects' boxes at the places of the grid, [N * 144], of levels.

    ``tiles`` is ``Nearby.elsewhere``.
    """
    tiled_bins, tiled_values = tiles
    first_lines = [jnp.array([of[k][:, 0] for of in _tile_lines(likelihood)]) for k in (0, 1)]
    height, width = _tile_shape(likelihood.windows)

    def of_object(number, boxes):
        level = likelihood.level[number]
        first_row, first_column = (of[level] for of in first_lines)

        def rows_of(count):
            """For each row of places, which rows belong to which part: bool [12, count, h]."""
            starts, size = boxes.top[:, 0], boxes.rows[0, 0]
            return _parts(starts, boxes.height[0, 0], count, size, first_row, height)

        def columns_of(count):
            starts, size = boxes.left[0], boxes.columns[0, 0]
            return _parts(starts, boxes.width[0, 0], count, size, first_column, width)

        score = jnp.broadcast_to(likelihood.offset[number], (PLACES, PLACES))
        weights = likelihood.colour_weights[number]
        score += _colour_score(tiled_bins[level], weights, boxes, rows_of, columns_of(1))
        weights = likelihood.gradient_weights[number]
        rows, columns = weights.shape[:2]
        pixels = tiled_values[level].reshape(PLACES, height, PLACES, width, -1)
        for product, part in (
            ("igy,iyjxc->igjxc", rows_of(rows)),
            ("jhx,igjxc->ijghc", columns_of(columns)),
        ):
            pixels = jnp.einsum(product, part.astype(pixels.dtype), pixels, precision="highest")
        least = least_sum(boxes, (rows, columns))[:, :, None, None, None]
        faded = jax.lax.rsqrt(jnp.sum(pixels, axis=-1, keepdims=True) + least)
        features = jnp.sqrt(pixels) * faded / math.sqrt(rows * columns)
        score += jnp.sum(features * weights, axis=(2, 3, 4))
        return score.ravel().astype(boxes.left.dtype)

    fields = tuple(jnp.reshape(x, (-1, PLACES, PLACES)) for x in boxes[:-1])
    return jax.lax.map(lambda item: of_object(item[0], Boxes(*item[1])), (partition, fields))


def _colour_score(bins, weights, boxes, rows_of, columns):
    """Scores [12, 12] of colours, by counting pixels of every bin, band and place."""
    num_bands, num_bins = weights.shape
    rows = rows_of(num_bands)
    inside = jnp.any(rows, axis=1).ravel()[:, None] & columns.ravel()
    row = (np.arange(PLACES)[:, None] * num_bands + jnp.argmax(rows, axis=1)).ravel()
    column = np.repeat(np.arange(PLACES), columns.shape[-1])
    place = (row[:, None] * PLACES + column) * (num_bins + 1)
    counts = jnp.zeros(num_bands * PLACES**2 * (num_bins + 1), jnp.int32)
    index = place + jnp.where(inside, bins, num_bins)
    counts = counts.at[index].add(1, mode="promise_in_bounds")
    counts = counts.reshape(PLACES, num_bands, PLACES, -1)[..., :num_bins]
    edges = jnp.stack(parts(boxes.top, boxes.height, num_bands), axis=-1)
    across = jnp.floor(boxes.left + boxes.width + 0.5) - jnp.floor(boxes.left + 0.5)
    area = across[..., None] * jnp.diff(jnp.floor(edges + 0.5), axis=-1)
    roots = jnp.einsum("ikjb,kb->ijk", jnp.sqrt(counts.astype(weights.dtype)), weights)
    scores = roots * jax.lax.rsqrt(jnp.maximum(area, 1))
    return jnp.sum(scores, axis=-1) / math.sqrt(num_bands)


def _parts(starts, extent, count, size, first, length):
    """Whether lines of tiles lie in each of ``count`` equal parts of boxes: [12, count, length]."""
    edges = [line_at(edge, size) - first for edge in parts(starts, extent, count)]
    limits, lines = jnp.stack(edges, axis=1)[..., None], np.arange(length)
    return (limits[:, :-1] <= lines) & (lines < limits[:, 1:])


def _tile_shape(shape: WindowShape) -> tuple[int, int]:
    """Height and width of a tile that contains the largest box, wherever it is rounded to."""
    return shape.height + 2 * _MARGIN + 4, shape.width + 2 * _MARGIN + 4


def _tile_lines(likelihood) -> list[list[np.ndarray]]:
    """For every level, rows [12, h] and columns [12, w] of the tiles."""

    def around(side: int, factor: int, length: int) -> np.ndarray:
        centres = (np.arange(PLACES) + 0.5) * side / PLACES / factor
        return np.floor(centres).astype(int)[:, None] - length // 2 + np.arange(length)

    sides = list(zip(likelihood.frame_shape, _tile_shape(likelihood.windows), strict=True))
    return [[around(side, factor, n) for side, n in sides] for factor in likelihood.factors]
