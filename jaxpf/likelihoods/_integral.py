"""Histograms of upright boxes from an integral histogram (Porikli, CVPR 2005).

``table[i, j, b]`` counts the pixels of bin b above row i and left of column j, modulo 2^16 or
2^32, so a box's count is a sum and difference of four corners.  It is exact as long as the true
count is below the modulus.  Bins come last, so that a corner of a box is one contiguous row.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.likelihoods._places import line_before
from jaxpf.lowering.columns import entries_at, sum_of_rows
from jaxpf.lowering.tables import sums_above_and_left

# Bins are processed in groups of this many: one or two vector registers on current CPUs.  The
# number of bins is a multiple of it.
LANES = 16
# In pixels: a bin with a smaller count contributes linearly, not by its root.
_ROUNDED = 0.1


@pytree_dataclass
class IntegralTable:
    """Sums above and left of every corner of a frame's pixels, either alone or in a stack.

    A table takes tens of megabytes, and slicing a stack of them would copy it.  So it keeps the
    whole stack and the index of its frame.

    Attributes:
        cells: of integers, ``[H + 1, W + 1, B]`` or ``[G, H + 1, W + 1, B]``.
        place: int32 [], index of the frame in the stack; 0 for a single frame.
        totals: the sum of ``cells`` over B, without the last axis; None where it is not needed.
    """

    cells: jax.Array
    place: jax.Array
    totals: Any = None

    def take_frame(self, index):
        """Frame ``index`` of a stack of G tables, whose ``place`` is ``[G]``."""
        return IntegralTable(self.cells, index, self.totals)


def integral_table(bins, num_bins: int, dtype) -> IntegralTable:
    """Integral histogram of a map of bins.

    Args:
        bins: integer [H, W]; pixels whose bin is ``num_bins`` or more are not counted.
        num_bins: number of bins, B.
        dtype: ``uint16`` or ``uint32``; counts wrap around.

    Returns:
        The table, its cells ``dtype`` [H + 1, W + 1, B].
    """
    # Pad with uncounted pixels to get row 0 and column 0 of the table.
    bins = jnp.pad(bins.astype(dtype), ((1, 0), (1, 0)), constant_values=num_bins)
    levels = jnp.arange(num_bins, dtype=bins.dtype)
    cells = sums_above_and_left(bins, lambda pixel: (pixel[..., None] == levels).astype(dtype))
    return IntegralTable(cells, jnp.zeros((), jnp.int32))


def integral_similarity(table, references, partition, left, top, width, height, region=None):
    """Sum over bands of the Bhattacharyya coefficient, for many upright boxes.

    Args:
        table: see :class:`IntegralTable`.
        references: [P, bands, B], square roots of the reference histograms.
        partition: int [N].
        left: [N], left edge, pixels.
        top: [N], top edge, pixels.
        width: [N], pixels, at least 1.
        height: [N], pixels, at least 1 per band.
        region: int32, four of [N]: first row, height, width and first column of the part of the
            table that each box lies in, from which ``top`` and ``left`` count.  By default the
            whole table.

    Returns:
        Similarity [N], and bool [N]: whether every band's count fits the table's dtype.
    """
    num_columns, num_bins = table.cells.shape[-2:]
    num_bands = references.shape[1]
    dtype = left.dtype
    groups = num_bins // LANES
    cells = table.cells.reshape(-1, LANES)
    origin, last_row, last_column = _bounds(table, region)
    references = references.astype(dtype).reshape(-1, LANES)

    # floor(x + 1/2), not round-half-to-even: a box at least a pixel wide keeps a column.
    x0, x1 = jnp.floor(left + 0.5), jnp.floor(left + width + 0.5)
    edges = [jnp.floor(top + height * (k / num_bands) + 0.5) for k in range(num_bands + 1)]
    column0, column1 = (jnp.clip(x, 0, last_column).astype(jnp.int32) for x in (x0, x1))
    rows = [jnp.clip(y, 0, last_row).astype(jnp.int32) for y in edges]

    def above(row, group):
        """Counts of the box's columns above an edge, for one group of bins."""
        start = origin + row * num_columns
        left_, right = ((start + column) * groups for column in (column0, column1))
        return entries_at(cells, right + group) - entries_at(cells, left_ + group)

    # One fused loop: gather LANES bins of every corner, difference, square root, multiply,
    # accumulate.  Slicing a gathered row of B bins, or summing the lanes inside the loop, would
    # break the fusion (each 3 times slower), hence the groups.
    total = jnp.zeros((*left.shape, LANES), dtype)
    fits = jnp.ones(left.shape, bool)
    largest_count = min(jnp.iinfo(cells.dtype).max, 2**31 - 1)  # pixels are int32
    for k in range(num_bands):
        band = jnp.zeros_like(total)
        for group in range(groups):
            count = above(rows[k + 1], group) - above(rows[k], group)
            # Counts are integers, so no gradient passes through this square root.
            root = jnp.sqrt(count.astype(dtype))
            reference = entries_at(references, (partition * num_bands + k) * groups + group)
            band += root * reference
        area = (x1 - x0) * (edges[k + 1] - edges[k])
        total += band * jax.lax.rsqrt(jnp.maximum(area, 1))[:, None]
        pixels = (column1 - column0) * (rows[k + 1] - rows[k])
        fits &= pixels <= largest_count
    return sum_of_rows(total), fits


def interpolated_integral_similarity(
    table, references, partition, left, top, width, height, region=None
):
    """As ``integral_similarity``, but smooth in the box: cut pixels count by their area inside.

    This equals bilinear interpolation of the integral histogram.  The count is continuous in the
    box, and its derivative is exact except where an edge of the box meets one of a pixel.
    ``sqrt(p)`` has an infinite slope at p = 0, where a bin appears, so it is replaced by
    ``p / sqrt(p + e)``, with e the weight of a tenth of a pixel.
    """
    num_columns, num_bins = table.cells.shape[-2:]
    num_bands = references.shape[1]
    dtype = left.dtype
    references = jnp.asarray(references, dtype)[partition]
    cells = table.cells.reshape(-1, num_bins)
    origin, last_row, last_column = _bounds(table, region)

    def place(x, last):
        line, beyond = line_before(x, last)
        return line, beyond[:, None]

    (column0, beyond0), (column1, beyond1) = (place(x, last_column) for x in (left, left + width))
    edges = [place(top + height * (k / num_bands), last_row) for k in range(num_bands + 1)]

    def take(row, column):
        return entries_at(cells, origin + row * num_columns + column)

    def lines(row):
        """Counts above a line of the table: between the columns, and in the two cut columns."""
        at0, at1 = take(row, column0), take(row, column1)
        return at1 - at0, take(row, column0 + 1) - at0, take(row, column1 + 1) - at1

    def between(upper, lower):
        """Count between two lines; integers are subtracted before conversion, so exactly."""
        whole, cut0, cut1 = ((b - a).astype(dtype) for a, b in zip(upper, lower, strict=True))
        return whole + beyond1 * cut1 - beyond0 * cut0

    above = [lines(row) for row, _ in edges]
    rest = [
        beyond * between(at, lines(row + 1)) for at, (row, beyond) in zip(above, edges, strict=True)
    ]
    area = (width * height / num_bands)[:, None]
    total = jnp.zeros_like(left)
    fits = jnp.ones(left.shape, bool)
    largest_count = min(jnp.iinfo(cells.dtype).max, 2**31 - 1)  # pixels are int32
    for k in range(num_bands):
        count = between(above[k], above[k + 1]) + rest[k + 1] - rest[k]
        share = jnp.maximum(count, 0) / jnp.maximum(area, 1)
        root = share * jax.lax.rsqrt(share + _ROUNDED / jnp.maximum(area, 1))
        total += jnp.sum(root * references[:, k], axis=-1)
        pixels = (column1 - column0) * (edges[k + 1][0] - edges[k][0])
        fits &= pixels <= largest_count
    return total, fits


#: The similarity of each interpolation.
SIMILARITIES = {"nearest": integral_similarity, "bilinear": interpolated_integral_similarity}


def _bounds(table, region):
    """Flat index of the first corner, last row and last column, of the table or of a region."""
    num_rows, num_columns = table.cells.shape[-3:-1]
    first_row = table.place * num_rows
    if region is None:
        return first_row * num_columns, num_rows - 1, num_columns - 1
    top, last_row, last_column, left = region
    return (first_row + top) * num_columns + left, last_row, last_column
