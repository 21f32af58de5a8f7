"""Sums over upright boxes and their cells, from integral tables (Porikli, CVPR 2005).

An entry of a table is the sum of a channel over all pixels above its row and left of its column.
So the sum over a box is a difference of four corners.  Channels are integers: differences are exact
in any order of summation, even if the sums wrap around, as long as the difference fits.  Channels
come last, so that a corner of a box is one contiguous row.

Features are roots of histograms.  Of colours, a channel counts the pixels of a bin, and a count is
divided by the area of a band of the box.  Of feature maps, a channel is a direction or a hue: with
c a cell's mean of a channel and s that of all channels together, the cell's feature is
``sqrt(c / (s + e))``, divided by the square root of the number of cells, so that it fades where
there is little to see.

Edges of boxes are rounded to lines between pixels; or with bilinear interpolation a pixel that an
edge cuts counts by its share.  Then sums are continuous in the box, and their derivatives exact
except where an edge of the box meets one of a pixel.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.pytree import as_array, pytree_dataclass
from jaxpf.lowering.columns import entries_at, sum_of_rows
from jaxpf.lowering.tables import sums_above_and_left

# Bins are processed in groups of this many: one or two vector registers on current CPUs.  The
# number of bins is a multiple of it.
LANES = 16
#: Interpolations of the edges of boxes.
INTERPOLATIONS = ("nearest", "bilinear")
#: Integer steps per unit of a map.
_STEPS = 255
#: e, in units of a map.
_FAINT = 0.03
#: For ``soft_root``: a tenth of a pixel of a bin, and a share of a cell.
_ROUNDED_COUNT, _ROUNDED_SHARE = 0.1, 1e-3


@pytree_dataclass
class IntegralTable:
    """Sums above and left of every corner of a frame's pixels, either alone or in a stack.

    A table takes tens of megabytes, and slicing a stack of them would copy it.  So it keeps the
    whole stack and the index of its frame.

    Attributes:
        cells: of integers, ``[H + 1, W + 1, C]`` or ``[G, H + 1, W + 1, C]``.
        place: int32 [], index of the frame in the stack; 0 for a single frame.
        totals: the sum of ``cells`` over C, without the last axis; None where it is not needed.
    """

    cells: jax.Array
    place: jax.Array
    totals: Any = None

    def take_frame(self, index):
        """Frame ``index`` of a stack of G tables, whose ``place`` is ``[G]``."""
        return IntegralTable(self.cells, index, self.totals)


class Boxes(NamedTuple):
    """N upright boxes in a picture, or each in a part of it, to which it is clipped.

    Attributes:
        left: [N], counted from the part's first column, pixels like all others.
        top: [N], counted from the part's first row.
        width: [N].
        height: [N].
        first_row: int32 [N], first row of the part.
        rows: int32 [N], the part's height.
        columns: int32 [N], the part's width.
        first_column: int32 [N], first column of the part.
    """

    left: jax.Array
    top: jax.Array
    width: jax.Array
    height: jax.Array
    first_row: jax.Array | int
    rows: jax.Array
    columns: jax.Array
    first_column: jax.Array | int = 0


def boxes_in(shape: tuple[int, int], left, top, width, height) -> Boxes:
    """Boxes in a whole picture of a height and width."""
    rows, columns = (jnp.full(left.shape, side, jnp.int32) for side in shape)
    return Boxes(left, top, width, height, 0, rows, columns)


def compacted(values: np.ndarray) -> tuple[jax.Array, np.ndarray]:
    """Number the bins that occur in references, so that a table has no others.

    Args:
        values: [P, bands, bins].

    Returns:
        int32 [bins], each bin's new number, or B; and the values of these, [P, bands, B].
    """
    used = np.flatnonzero(values.any(axis=(0, 1)))
    num_bins = -(-len(used) // LANES) * LANES
    lookup = np.full(values.shape[-1], num_bins, np.int32)
    lookup[used] = np.arange(len(used))
    compact = np.zeros((*values.shape[:2], num_bins))
    compact[..., : len(used)] = values[..., used]
    return as_array(lookup), compact


def integral_table(bins, num_bins: int, dtype) -> IntegralTable:
    """Integral histogram of a map of bins.

    Args:
        bins: integer [H, W]; pixels whose bin is ``num_bins`` or more are not counted.
        num_bins: number of bins, B.
        dtype: ``uint16`` or ``uint32``; counts wrap around.
    """
    # Pad with uncounted pixels to get row 0 and column 0 of the table.
    bins = jnp.pad(bins.astype(dtype), ((1, 0), (1, 0)), constant_values=num_bins)
    levels = jnp.arange(num_bins, dtype=bins.dtype)
    cells = sums_above_and_left(bins, lambda pixel: (pixel[..., None] == levels).astype(dtype))
    return IntegralTable(cells, jnp.zeros((), jnp.int32))


def sum_table(values: jax.Array) -> IntegralTable:
    """The integral table of a map, float [h, w, C], 0 to 1."""
    cells = jnp.pad(
        sums_above_and_left(whole_values(values), lambda pixel: pixel), ((1, 0), (1, 0), (0, 0))
    )
    return IntegralTable(cells, jnp.zeros((), jnp.int32), cells.sum(axis=-1, dtype=cells.dtype))


def whole_values(values: jax.Array) -> jax.Array:
    """A map's values, 0 to 1, in integer steps of 1/255, int32."""
    return jnp.round(jnp.clip(values, 0, 1) * _STEPS).astype(jnp.int32)


def similarity(table, references, partition, boxes: Boxes, interpolation: str):
    """Sum over bands of the Bhattacharyya coefficient of boxes, [N].

    Args:
        table: from ``integral_table``.
        references: [P, bands, B], square roots of the reference histograms.
        partition: int [N].
        boxes: at least a pixel wide, and high for each band.
        interpolation: one of ``INTERPOLATIONS``.
    """
    bands, dtype = references.shape[1], boxes.left.dtype
    references = references.astype(dtype)
    if interpolation == "bilinear":
        area = jnp.maximum(boxes.width * boxes.height / bands, 1)[:, None, None]
        share = jnp.maximum(_cut_sums(table, boxes, (bands, 1))[:, :, 0], 0) / area
        roots = soft_root(share, _ROUNDED_COUNT / area)
        return jnp.sum(roots * references[partition], axis=(1, 2))
    groups = table.cells.shape[-1] // LANES
    cells, references = table.cells.reshape(-1, LANES), references.reshape(-1, LANES)
    origin, stride = _origin(table, boxes)
    sides = [jnp.floor(x + 0.5) for x in (boxes.left, boxes.left + boxes.width)]
    edges = [jnp.floor(y + 0.5) for y in parts(boxes.top, boxes.height, bands)]
    columns = [jnp.clip(x, 0, boxes.columns).astype(jnp.int32) for x in sides]
    rows = [jnp.clip(y, 0, boxes.rows).astype(jnp.int32) for y in edges]

    def above(row, group):
        """Counts of the box's columns above an edge, for one group of bins."""
        left, right = ((origin + row * stride + column) * groups + group for column in columns)
        return entries_at(cells, right) - entries_at(cells, left)

    # One fused loop: gather LANES bins of every corner, difference, square root, multiply,
    # accumulate.  Slicing a gathered row of B bins, or summing the lanes inside the loop, would
    # break the fusion (each 3 times slower), hence the groups.
    total = jnp.zeros((*boxes.left.shape, LANES), dtype)
    for k in range(bands):
        band = jnp.zeros_like(total)
        for group in range(groups):
            count = above(rows[k + 1], group) - above(rows[k], group)
            # Counts are integers, so no gradient passes through this square root.
            root = jnp.sqrt(count.astype(dtype))
            band += root * entries_at(references, (partition * bands + k) * groups + group)
        area = (sides[1] - sides[0]) * (edges[k + 1] - edges[k])
        total += band * jax.lax.rsqrt(jnp.maximum(area, 1))[:, None]
    return sum_of_rows(total)


def counts_fit(table, boxes: Boxes, bands: int):
    """Whether every band has so few pixels that their counts fit the table's dtype, bool [N]."""
    left, right = (line_at(x, boxes.columns) for x in parts(boxes.left, boxes.width, 1))
    rows = jnp.stack([line_at(y, boxes.rows) for y in parts(boxes.top, boxes.height, bands)])
    largest = min(jnp.iinfo(table.cells.dtype).max, 2**31 - 1)  # pixels are int32
    return jnp.all((right - left) * jnp.diff(rows, axis=0) <= largest, axis=0)


def cell_features(
    table: IntegralTable, boxes: Boxes, grid: tuple[int, ...], interpolation: str
) -> jax.Array:
    """Features of the cells of boxes, [N, rows, columns, C].

    Args:
        table: from ``sum_table``.
        boxes: N of them.
        grid: rows and columns of cells.
        interpolation: one of ``INTERPOLATIONS``.
    """
    bilinear = interpolation == "bilinear"
    sums = (_cut_sums if bilinear else _whole_sums)(table, boxes, grid)
    total = jnp.sum(sums, axis=-1, keepdims=True) + least_sum(boxes, grid)[:, None, None, None]
    share = sums / total
    root = soft_root(jnp.maximum(share, 0), _ROUNDED_SHARE) if bilinear else jnp.sqrt(share)
    return root / math.sqrt(grid[0] * grid[1])


def cell_score(
    table: IntegralTable, weights: jax.Array, partition: jax.Array, boxes: Boxes
) -> jax.Array:
    """``sum(cell_features * weights)`` [N] of whole pixels, in a tenth of the time.

    Args:
        table: from ``sum_table``.
        weights: [P, rows, columns, C].
        partition: int [N].
        boxes: N of them.
    """
    grid = (weights.shape[1], weights.shape[2])
    cells, totals = table.cells.reshape(-1, table.cells.shape[-1]), table.totals.reshape(-1)
    origin, stride = _origin(table, boxes)
    weights = (weights / math.sqrt(grid[0] * grid[1])).reshape(-1, cells.shape[-1])
    dtype = boxes.left.dtype
    columns = [line_at(x, boxes.columns) for x in parts(boxes.left, boxes.width, grid[1])]
    rows = [line_at(y, boxes.rows) for y in parts(boxes.top, boxes.height, grid[0])]
    # Barrier: compiled twice with different rounding, an edge half way between two lines could go
    # to one line here and to the other there, and the sums of cells would be inconsistent.
    starts = jnp.stack([origin + row * stride for row in rows])
    starts, columns = jax.lax.optimization_barrier((starts, columns))
    least = least_sum(boxes, grid)

    def strip(table, start, j):
        """Sums above a row's edge, in one column of cells."""
        return entries_at(table, start + columns[j + 1]) - entries_at(table, start + columns[j])

    def add_row(i, total):
        # One fused loop over the particles' channels: gather, difference, root, multiply, add.
        above, below = starts[i], starts[i + 1]
        for j in range(grid[1]):
            here, seen = (strip(t, below, j) - strip(t, above, j) for t in (cells, totals))
            weight = entries_at(weights, (partition * grid[0] + i) * grid[1] + j)
            faded = jax.lax.rsqrt(seen.astype(dtype) + least)
            total += jnp.sqrt(here.astype(dtype)) * weight * faded[:, None]
        return total

    total = jnp.zeros((len(partition), cells.shape[-1]), dtype)
    return sum_of_rows(jax.lax.fori_loop(0, grid[0], add_row, total))


def soft_root(share: jax.Array, rounded: jax.Array | float) -> jax.Array:
    """The square root, but linear far below ``rounded``: its slope is infinite at 0.

    There a bin or a channel appears.
    """
    return share * jax.lax.rsqrt(share + rounded)


def parts(start: jax.Array, extent: jax.Array, count: int) -> list[jax.Array]:
    """Edges of ``count`` equal parts of a side, from its start on."""
    return [start + extent * (k / count) for k in range(count + 1)]


def line_at(place: jax.Array, size: jax.Array) -> jax.Array:
    """The line between pixels nearest to a position, int32, clipped to 0 and the size."""
    # floor(x + 1/2), not round-half-to-even: a box at least a pixel wide keeps a column.
    return jnp.floor(jnp.clip(place, 0, size.astype(place.dtype)) + 0.5).astype(jnp.int32)


def line_before(place: jax.Array, last) -> tuple[jax.Array, jax.Array]:
    """The line at or before a position clipped to 0 to ``last``, int32, and the share beyond it.

    The line is at most ``last - 1``, so that a next one exists; the share has a derivative.
    """
    place = jnp.clip(place, 0, last)
    line = jnp.clip(jnp.floor(jax.lax.stop_gradient(place)), 0, jnp.maximum(last - 1, 0))
    return line.astype(jnp.int32), place - line


def least_sum(boxes: Boxes, grid: tuple[int, ...]) -> jax.Array:
    """e times the area of a cell, [N], in the table's units."""
    area = boxes.width * boxes.height / (grid[0] * grid[1])
    return (_STEPS * _FAINT) * jnp.maximum(area, 1e-3)


def _origin(table: IntegralTable, boxes: Boxes) -> tuple[jax.Array, int]:
    """Flat index of the first corner of each box's part in the stack, and the table's width."""
    num_rows, stride = table.cells.shape[-3:-1]
    return (table.place * num_rows + boxes.first_row) * stride + boxes.first_column, stride


def _whole_sums(table, boxes, grid):
    """Sums over cells, [N, rows, columns, C]."""
    cells = table.cells.reshape(-1, table.cells.shape[-1])
    origin, stride = _origin(table, boxes)
    rows = [line_at(y, boxes.rows) for y in parts(boxes.top, boxes.height, grid[0])]
    columns = [line_at(x, boxes.columns) for x in parts(boxes.left, boxes.width, grid[1])]
    start = jnp.stack([origin + row * stride for row in rows], axis=-1)
    corners = entries_at(cells, start[:, :, None] + jnp.stack(columns, axis=-1)[:, None, :])
    strips = corners[:, :, 1:] - corners[:, :, :-1]
    return (strips[:, 1:] - strips[:, :-1]).astype(boxes.left.dtype)


def _cut_sums(table, boxes, grid):
    """The same with cut pixels by their share: bilinear interpolation of the table."""
    cells, dtype = table.cells.reshape(-1, table.cells.shape[-1]), boxes.left.dtype
    origin, stride = _origin(table, boxes)
    rows, columns = (
        [line_before(edge, size.astype(dtype)) for edge in parts(start, extent, count)]
        for start, extent, count, size in (
            (boxes.top, boxes.height, grid[0], boxes.rows),
            (boxes.left, boxes.width, grid[1], boxes.columns),
        )
    )

    def line(row):
        """Sums above a line: left of the columns' edges, and in the pixels that these cut."""
        start = origin + row * stride
        at = [entries_at(cells, start + column) for column, _ in columns]
        after = [entries_at(cells, start + column + 1) for column, _ in columns]
        return at, [b - a for a, b in zip(at, after, strict=True)]

    def between(upper, lower):
        """Sums between two lines; integers are subtracted before conversion, so exactly."""
        (at0, cut0), (at1, cut1) = upper, lower
        cut = [
            beyond[:, None] * (b - a).astype(dtype)
            for a, b, (_, beyond) in zip(cut0, cut1, columns, strict=True)
        ]
        whole = [b - a for a, b in zip(at0, at1, strict=True)]
        return [
            (whole[j + 1] - whole[j]).astype(dtype) + cut[j + 1] - cut[j] for j in range(grid[1])
        ]

    above = [line(row) for row, _ in rows]
    rest = [
        [below[:, None] * x for x in between(at, line(row + 1))]
        for at, (row, below) in zip(above, rows, strict=True)
    ]
    sums = []
    for k in range(grid[0]):
        cells_of_row = zip(between(above[k], above[k + 1]), rest[k], rest[k + 1], strict=True)
        sums.append(jnp.stack([whole + after - before for whole, before, after in cells_of_row], 1))
    return jnp.stack(sums, axis=1)
