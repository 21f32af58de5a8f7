"""Histograms of boxes at any angle, from pixels sampled in groups of four.

A box is covered by a grid of groups, each of four pixels at the corners of an upright square.  The
codes of a group form one 32-bit word of a table built once per frame, so one gather fetches four
pixels.  On a CPU a gather takes several nanoseconds regardless of its size.

With n samples of a band whose pixels fall in K bins, the sampled d^2 is biased upwards by about
(K - 1) / (8 n) (less as n approaches the number of pixels), plus scatter.  The bias is nearly the
same for every particle, so it hardly changes the weights.

Interpolated, the histogram changes smoothly with the box.  Each of n places spreads its weight
1 / n over the four pixels around it with bilinear weights, and each pixel counts in its own bin:
colours are not mixed.  The weights are linear in the place, and the place is smooth in position,
scale and angle, so the derivative is exact unless a place lies exactly on a line through pixel
centres.
"""

import math

import jax
import jax.numpy as jnp

from jaxpf.likelihoods._places import cell_centres, places_in_image
from jaxpf.lowering.columns import sum_of_rows, words_at

#: Levels are counted in groups of this many, which fill vector registers.
LEVEL_LANES = 8
#: Code of pixels outside the frame; bins are smaller, and codes have 7 bits.
OUTSIDE = 127
# Number of groups whose codes are compared in one unrolled piece of code.
_UNROLLED = 64
#: Distance in pixels between the samples of a group that is interpolated: adjacent.
NEIGHBOURS = 1
# Entry (i, j) of its table begins with pixel (i - _MARGIN, j - _MARGIN).
_MARGIN = NEIGHBOURS + 1

# A bin with less than this share of a place contributes linearly, not by its root: the slope of
# sqrt(p) is infinite at p = 0, where a bin appears.
_ROUNDED = 0.1


def group_distance(num_samples, num_bands, sizes) -> int:
    """Pixels between the samples of a group: half the (geometric) mean distance between groups.

    Args:
        num_samples: samples per side of a box, S.
        num_bands: horizontal bands of a box.
        sizes: [P][2], width and height of the boxes, pixels.
    """
    columns, rows = _grid(num_samples, num_bands)
    spacings = [x for w, h in sizes for x in (w / (2 * columns), h / (2 * rows * num_bands))]
    return max(1, round(math.exp(sum(map(math.log, spacings)) / len(spacings))))


def sample_table(bins, distance):
    """The table of one frame, with the codes of four pixels per entry.

    Args:
        bins: integer [H, W], below ``OUTSIDE``.
        distance: pixels between the samples of a group, d.

    Returns:
        uint32 [H + d + 2, W + d + 2]: entry (i, j) holds pixel (i - d - 1, j - d - 1) and its
        neighbours d columns, d rows, and both, further; pixels outside the frame are ``OUTSIDE``.
    """
    margin = distance + 1
    before, after = margin, margin + distance
    codes = jnp.pad(
        bins.astype(jnp.uint32), ((before, after), (before, after)), constant_values=OUTSIDE
    )
    rows, columns = (size + distance + 2 for size in bins.shape)
    table = jnp.zeros((rows, columns), jnp.uint32)
    for k, (down, right) in enumerate(((0, 0), (0, distance), (distance, 0), (distance, distance))):
        table |= codes[down : down + rows, right : right + columns] << (8 * k)
    return table


def sampled_similarity(
    table, distance, num_samples, levels, roots, partition, u, v, width, height, cosine, sine
):
    """Sum over bands of the Bhattacharyya coefficient, for many rotated boxes.

    Args:
        table: uint32, see :func:`sample_table`.
        distance: pixels between the samples of a group, as given to :func:`sample_table`.
        num_samples: samples per side of the box, S: the box gets at least S / 2 columns and
            rows of groups, the same number of rows in each band.
        levels: integer [P, bands, K], bins that each object's references use.
        roots: [P, bands, K], square roots of the references in these bins.
        partition: int [N].
        u, v, width, height, cosine, sine: [N], the boxes, see ``places_in_image``.

    Returns:
        Similarity [N].
    """
    num_bands = levels.shape[1]
    dtype = u.dtype
    columns, rows = _grid(num_samples, num_bands)
    across, down = cell_centres(columns, rows * num_bands)
    x, y = places_in_image(across, down, u, v, width, height, cosine, sine)
    margin = distance + 1
    last_row, last_column = (size - 1 for size in table.shape)
    # A group's first pixel is d / 2 above and left of its centre.  From 0 on, the cast floors.
    column = jnp.clip(x + (margin - distance / 2), 0, last_column).astype(jnp.int32)
    row = jnp.clip(y + (margin - distance / 2), 0, last_row).astype(jnp.int32)
    words = words_at(table, row, column)

    words = words.reshape(-1, num_bands, rows, columns)
    levels = levels.astype(jnp.uint32)[partition]
    similarity = jnp.zeros_like(u)
    for k in range(num_bands):
        counts = _counts(words[:, k], levels[:, k])
        root = jnp.sqrt(counts.astype(dtype) / (4 * rows * columns))
        similarity += sum_of_rows(root * roots.astype(dtype)[partition, k])
    return similarity


def interpolated_similarity(
    table, num_samples, levels, roots, partition, u, v, width, height, cosine, sine
):
    """Sum over bands of the Bhattacharyya coefficient, for many rotated boxes.

    ``sqrt(p)`` is smoothed at 0: ``p / sqrt(p + e)``, with e a tenth of a place's weight.

    Args:
        table: uint32, ``sample_table(bins, NEIGHBOURS)``.
        num_samples: places per side of the box, S.
        levels, roots, partition: as for :func:`sampled_similarity`.
        u, v, width, height, cosine, sine: [N], the boxes, see ``places_in_image``.

    Returns:
        Similarity [N].
    """
    num_bands = levels.shape[1]
    dtype = u.dtype
    rows = -(-num_samples // num_bands)
    across, down = cell_centres(num_samples, rows * num_bands)
    x, y = places_in_image(across, down, u, v, width, height, cosine, sine)
    left, top = jnp.floor(x - 0.5), jnp.floor(y - 0.5)
    right_share, lower_share = x - 0.5 - left, y - 0.5 - top
    last_row, last_column = (size - 1 for size in table.shape)
    column = jnp.clip(left + _MARGIN, 0, last_column).astype(jnp.int32)
    row = jnp.clip(top + _MARGIN, 0, last_row).astype(jnp.int32)
    words = words_at(table, row, column)
    # In the byte order of a word, [N, bands, places, 4].
    left_share, upper_share = 1 - right_share, 1 - lower_share
    shares = jnp.stack(
        [
            upper_share * left_share,
            upper_share * right_share,
            lower_share * left_share,
            lower_share * right_share,
        ],
        axis=-1,
    ).reshape(len(words), num_bands, -1, 4)
    codes = (words[..., None] >> jnp.arange(0, 32, 8, dtype=jnp.uint32)) & 0xFF
    codes = codes.astype(jnp.int32).reshape(shares.shape)

    levels = levels[partition]
    roots = roots.astype(dtype)[partition]
    weight = 1 / (num_samples * rows)
    share_of_bin = weight * _summed_shares(codes, shares, levels)
    root = share_of_bin * jax.lax.rsqrt(share_of_bin + _ROUNDED * weight)
    return jnp.sum(root * roots, axis=(1, 2))


def _grid(num_samples, num_bands) -> tuple[int, int]:
    """Number of columns of groups, and of rows of groups per band."""
    return -(-num_samples // 2), -(-num_samples // (2 * num_bands))


def _counts(words, levels):
    """Count the codes that equal each level: int32 [N, K].

    ``words`` is [N, rows, columns], ``levels`` [N, K].  Four codes of 7 bits are compared at once:
    a byte of ``(word ^ level) + 0x7f`` has its highest bit set unless the codes are equal, and
    these bits are summed byte by byte.  A scatter-add does less work, but under ``vmap`` it
    becomes a scalar loop, ten times slower on a CPU.
    """
    num_rows, num_columns = words.shape[1:]
    together = max(
        r
        for r in range(1, num_rows + 1)
        if num_rows % r == 0 and r * num_columns <= max(_UNROLLED, num_columns)
    )
    levels = levels * jnp.uint32(0x01010101)
    pieces = words.reshape(words.shape[0], num_rows // together, together * num_columns)

    def add_piece(i, misses):
        piece = jax.lax.dynamic_index_in_dim(pieces, i, 1, keepdims=False)
        by_byte = jnp.zeros(levels.shape, jnp.uint32)
        for j in range(piece.shape[1]):
            differs = ((piece[:, j, None] ^ levels) + jnp.uint32(0x7F7F7F7F)) >> 7
            by_byte += differs & jnp.uint32(0x01010101)
        pairs = (by_byte & jnp.uint32(0x00FF00FF)) + ((by_byte >> 8) & jnp.uint32(0x00FF00FF))
        return misses + (pairs & jnp.uint32(0xFFFF)) + (pairs >> 16)

    none = jnp.zeros(levels.shape, jnp.uint32)
    misses = jax.lax.fori_loop(0, num_rows // together, add_piece, none)
    return (4 * num_rows * num_columns - misses).astype(jnp.int32)


def _summed_shares(codes, shares, levels):
    """Sums of the shares per level, [N, bands, K], from codes and shares [N, bands, n, 4]."""
    boxes = math.prod(codes.shape[:2])
    # A scatter-add per code: comparing all codes with all levels is 6 to 13 times slower.
    table = jnp.zeros((boxes, OUTSIDE + 1), shares.dtype)
    table = table.at[jnp.arange(boxes)[:, None], codes.reshape(boxes, -1)].add(
        shares.reshape(boxes, -1), mode="promise_in_bounds"
    )
    return jnp.take_along_axis(table.reshape(*codes.shape[:2], -1), levels, axis=-1)
