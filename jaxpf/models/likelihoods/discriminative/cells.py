"""Cells of boxes: maps of features summed over a grid, by integral tables.

``table[i, j, c]`` is the sum of channel c above row i and left of column j, of values that were
rounded to whole numbers: a difference of sums is exact in whatever order they were added, also
where they wrap around.  Channels come last: the corner of a cell is one contiguous row.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxpf.lowering.columns import entries_at
from jaxpf.models.likelihoods._integral import IntegralTable

#: Whole numbers per unit of a map.
_STEPS = 255
#: A cell whose mean is shorter than this counts in proportion, not by its direction alone.
_FAINT = 0.5 / 16


class Boxes(NamedTuple):
    """N upright boxes in the picture of all levels, each within the rows and columns of its own.

    Attributes:
        left: [N], pixels of the picture, like all others.
        top: [N], counted from the level's first row.
        width: [N].
        height: [N].
        first_row: int32 [N], where the level begins.
        rows: int32 [N], the level's height.
        columns: int32 [N], its width.
    """

    left: jax.Array
    top: jax.Array
    width: jax.Array
    height: jax.Array
    first_row: jax.Array
    rows: jax.Array
    columns: jax.Array


def sum_table(values: jax.Array) -> IntegralTable:
    """The integral table of a map.

    Args:
        values: float [h, w, C], 0 to 1.

    Returns:
        The table, its cells uint32 [h + 1, w + 1, C].
    """
    whole = jnp.round(jnp.clip(values, 0, 1) * _STEPS).astype(jnp.uint32)
    cells = jax.lax.platform_dependent(whole, cpu=_by_rows, default=_at_once)
    return IntegralTable(jnp.pad(cells, ((1, 0), (1, 0), (0, 0))), jnp.zeros((), jnp.int32))


def _by_rows(values):
    """Two nested scans: on a CPU a row's running sums stay in registers and cache."""

    def add_row(above, row):
        def add_pixel(total, pixel):
            value, sum_above = pixel
            total = total + value
            return total, sum_above + total

        _, sums = jax.lax.scan(add_pixel, jnp.zeros_like(row[0]), (row, above))
        return sums, sums

    return jax.lax.scan(add_row, jnp.zeros_like(values[0]), values)[1]


def _at_once(values):
    """Two cumulative sums: one big operation each, for a device with many threads."""
    return jnp.cumsum(jnp.cumsum(values, axis=1, dtype=values.dtype), axis=0, dtype=values.dtype)


def cell_features(
    table: IntegralTable, boxes: Boxes, grid: tuple[int, int], interpolation: str
) -> jax.Array:
    """Means over the cells of boxes, each cell over its norm and all together a unit vector.

    Args:
        table: of a map with C channels.
        boxes: N of them.
        grid: rows and columns of cells.
        interpolation: ``"nearest"``, where edges of cells lie between pixels, or ``"bilinear"``,
            where a pixel that an edge cuts counts by its share.

    Returns:
        [N, rows, columns, C].
    """
    sums = (_cut_sums if interpolation == "bilinear" else _whole_sums)(table, boxes, grid)
    area = boxes.width * boxes.height / (grid[0] * grid[1])
    means = sums / (_STEPS * jnp.maximum(area, 1e-6))[:, None, None, None]
    # A little is added under roots: their slope at 0 is infinite.
    length = jnp.sqrt(jnp.sum(means**2, axis=-1, keepdims=True) + 1e-12)
    cells = means / (length + _FAINT)
    return cells * jax.lax.rsqrt(jnp.sum(cells**2, axis=(1, 2, 3), keepdims=True) + 1e-6)


def _edges(boxes: Boxes, grid: tuple[int, int]) -> tuple[jax.Array, jax.Array]:
    """Edges of cells within the level: rows [N, grid[0] + 1] and columns [N, grid[1] + 1]."""
    dtype = boxes.left.dtype

    def along(start, extent, count, size):
        places = start[:, None] + extent[:, None] * (jnp.arange(count + 1, dtype=dtype) / count)
        return jnp.clip(places, 0, size[:, None].astype(dtype))

    return (
        along(boxes.top, boxes.height, grid[0], boxes.rows),
        along(boxes.left, boxes.width, grid[1], boxes.columns),
    )


def _flat(table: IntegralTable, boxes: Boxes) -> tuple[jax.Array, jax.Array, int]:
    """Rows of channels, every box's first row among those of a stack of tables, and their width."""
    num_rows, num_columns, channels = table.cells.shape[-3:]
    return table.cells.reshape(-1, channels), table.place * num_rows + boxes.first_row, num_columns


def _whole_sums(table, boxes, grid):
    cells, first_row, stride = _flat(table, boxes)
    # floor(x + 1/2), not round-half-to-even, as histograms of boxes have it.
    rows, columns = (jnp.floor(x + 0.5).astype(jnp.int32) for x in _edges(boxes, grid))
    start = (first_row[:, None] + rows) * stride
    corners = entries_at(cells, start[:, :, None] + columns[:, None, :])
    strips = corners[:, :, 1:] - corners[:, :, :-1]
    return (strips[:, 1:] - strips[:, :-1]).astype(boxes.left.dtype)


def _cut_sums(table, boxes, grid):
    cells, first_row, stride = _flat(table, boxes)
    dtype = boxes.left.dtype

    def lines(places, size):
        """The last line at or before a place, and how far the place is beyond it."""
        line = jnp.floor(jax.lax.stop_gradient(places))
        line = jnp.clip(line, 0, jnp.maximum(size[:, None] - 1, 0).astype(dtype))
        return line.astype(jnp.int32), places - line

    rows, columns = _edges(boxes, grid)
    row, below = lines(rows, boxes.rows)
    column, beyond = lines(columns, boxes.columns)

    def strips(row):
        """Sums above lines between the columns' edges; whole numbers are subtracted first."""
        start = ((first_row[:, None] + row) * stride)[:, :, None] + column[:, None, :]
        at = entries_at(cells, start)
        cut = (entries_at(cells, start + 1) - at).astype(dtype) * beyond[:, None, :, None]
        whole = (at[:, :, 1:] - at[:, :, :-1]).astype(dtype)
        return whole + cut[:, :, 1:] - cut[:, :, :-1]

    above, under = strips(row), strips(row + 1)
    sums = above + below[:, :, None, None] * (under - above)
    return sums[:, 1:] - sums[:, :-1]
