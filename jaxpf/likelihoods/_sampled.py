"""Pixels sampled on a grid in boxes at any angle: their colours, and histograms of them.

Pixel (i, j), row i and column j, is the square [j, j + 1) x [i, i + 1); pixels outside the frame
are black, or in no bin.

For histograms, a box is covered by a grid of groups, each of four pixels at the corners of an
upright square.  The codes of a group form one 32-bit word of a table built once per frame, so one
gather fetches four pixels.  On a CPU a gather takes several nanoseconds regardless of its size.

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
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxpf.likelihoods._integral import soft_root
from jaxpf.lowering.columns import sum_of_rows, words_at
from jaxpf.shapes.rectangles import cos_sin

#: Levels are counted in groups of this many, which fill vector registers.
LEVEL_LANES = 8
#: Distance in pixels between the samples of a group that is interpolated: adjacent.
NEIGHBOURS = 1
#: Code of pixels outside the frame; bins are smaller, and codes have 7 bits.
_OUTSIDE = 127
#: Number of groups whose codes are compared in one unrolled piece of code.
_UNROLLED = 64
#: Share of a place's weight below which a bin counts linearly, see ``soft_root``.
_ROUNDED = 0.1


class Turned(NamedTuple):
    """N boxes: centre u and v, width and height in pixels, [N] each.

    The angle theta is in radians, clockwise in the image.
    """

    u: jax.Array
    v: jax.Array
    width: jax.Array
    height: jax.Array
    theta: jax.Array


def places_in_image(columns: int, rows: int, boxes: Turned) -> tuple[jax.Array, jax.Array]:
    """Image coordinates x and y, ``[N, rows * columns]`` each, of a grid in every box."""
    # Offsets from the box's centre as shares of its width and height, row by row.
    across = jnp.tile((jnp.arange(columns) + 0.5) / columns - 0.5, rows)
    down = jnp.repeat((jnp.arange(rows) + 0.5) / rows - 0.5, columns)
    u, v, width, height, theta = boxes
    cosine, sine = cos_sin(theta)
    # A matrix product, because XLA would fuse any other form into the following gather, and there
    # compute everything, sines included, one scalar at a time.
    pose = jnp.stack([u, v, cosine * width, sine * height, sine * width, cosine * height], axis=-1)
    none, unit = jnp.zeros_like(across), jnp.ones_like(across)
    x_of_pose = jnp.stack([unit, none, across, -down, none, none])
    y_of_pose = jnp.stack([none, unit, none, none, across, down])
    to_places = jnp.concatenate([x_of_pose, y_of_pose], axis=1).astype(u.dtype)
    x, y = jnp.split(jnp.dot(pose, to_places, precision=jax.lax.Precision.HIGHEST), 2, axis=-1)
    return x, y


def words_of(frame):
    """The colours of uint8 RGB [H, W, 3], one word per pixel: uint32 [H + 2, W + 2]."""
    red, green, blue = (frame[..., k].astype(jnp.uint32) for k in range(3))
    return jnp.pad(red | green << 8 | blue << 16, 1)


def window_colours(words, boxes: Turned, window: tuple[int, int]):
    """Colours on a grid of columns and rows in every box: [N, rows * columns, 3]."""
    # The first row and column of ``words`` are the black margin.
    x, y = (jnp.floor(place) + 1 for place in places_in_image(*window, boxes))
    shifts = jnp.array([0, 8, 16], jnp.uint32)
    return ((_taken(words, x, y)[..., None] >> shifts) & 255).astype(x.dtype)


def group_distance(num_samples, num_bands, sizes) -> int:
    """Pixels between the samples of a group: half the (geometric) mean distance between groups.

    Args:
        num_samples: samples per side of a box, S.
        num_bands: horizontal bands of a box.
        sizes: [P][2], width and height of the boxes, pixels.
    """
    columns, rows = -(-num_samples // 2), -(-num_samples // (2 * num_bands))
    spacings = [x for w, h in sizes for x in (w / (2 * columns), h / (2 * rows * num_bands))]
    return max(1, round(math.exp(sum(map(math.log, spacings)) / len(spacings))))


def sample_table(bins, distance):
    """The table of one frame, with the codes of four pixels per entry.

    Args:
        bins: integer [H, W], below 127.
        distance: pixels between the samples of a group, d.

    Returns:
        uint32 [H + d + 2, W + d + 2]: entry (i, j) holds pixel (i - d - 1, j - d - 1) and its
        neighbours d columns, d rows, and both, further; pixels outside the frame are 127.
    """
    padding = (distance + 1, 2 * distance + 1)
    codes = jnp.pad(bins.astype(jnp.uint32), (padding, padding), constant_values=_OUTSIDE)
    rows, columns = (size + distance + 2 for size in bins.shape)
    table = jnp.zeros((rows, columns), jnp.uint32)
    for k, (down, right) in enumerate(((0, 0), (0, distance), (distance, 0), (distance, distance))):
        table |= codes[down : down + rows, right : right + columns] << (8 * k)
    return table


def sampled_similarity(
    table, distance, num_samples, levels, roots, partition, boxes: Turned, interpolation: str
):
    """Sum over bands of the Bhattacharyya coefficient of boxes, [N].

    Args:
        table: from ``sample_table``.
        distance: d, as given to it; ``NEIGHBOURS`` if interpolated.
        num_samples: S, samples or interpolated places per side of a box: it gets at least S / 2
            columns and rows of groups, or S of places, and each band the same number of rows.
        levels: integer [P, bands, K], bins that each object's references use.
        roots: [P, bands, K], square roots of the references in these bins.
        partition: int [N].
        boxes: N of them.
        interpolation: ``"nearest"`` or ``"bilinear"``.
    """
    bilinear, bands, dtype = interpolation == "bilinear", levels.shape[1], boxes.u.dtype
    side = 1 if bilinear else 2
    columns, rows = -(-num_samples // side), -(-num_samples // (side * bands))
    # A group's first pixel is d / 2 above and left of its centre.
    shift = distance + 1 - distance / 2
    x, y = (place + shift for place in places_in_image(columns, rows * bands, boxes))
    words = _taken(table, x, y).reshape(-1, bands, rows, columns)
    levels, roots = levels[partition], roots.astype(dtype)[partition]
    if bilinear:
        shares = (place - jnp.floor(place) for place in (x, y))
        right, lower = (share.reshape(words.shape) for share in shares)
        weight = 1 / (rows * columns)
        share_of_bin = weight * _summed_shares(words, right, lower, levels)
        return jnp.sum(soft_root(share_of_bin, _ROUNDED * weight) * roots, axis=(1, 2))
    total = jnp.zeros_like(boxes.u)
    for k in range(bands):
        counts = _counts(words[:, k], levels[:, k].astype(jnp.uint32))
        root = jnp.sqrt(counts.astype(dtype) / (4 * rows * columns))
        total += sum_of_rows(root * roots[:, k])
    return total


def _taken(table, x, y):
    """Entries of a table at places [N, G], clipped to it."""
    last_row, last_column = (size - 1 for size in table.shape)
    # From 0 on, the cast floors.
    column = jnp.clip(x, 0, last_column).astype(jnp.int32)
    return words_at(table, jnp.clip(y, 0, last_row).astype(jnp.int32), column)


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


def _summed_shares(words, right, lower, levels):
    """Sums over places of the shares of their four pixels per level, [N, bands, K].

    ``words`` are [N, bands, rows, columns] like the shares of the right and of the lower pixels;
    ``levels`` is [N, bands, K].
    """
    # In the byte order of a word.
    shares = jnp.stack([y * x for y in (1 - lower, lower) for x in (1 - right, right)], axis=-1)
    codes = (words[..., None] >> jnp.arange(0, 32, 8, dtype=jnp.uint32)) & 0xFF
    boxes = math.prod(levels.shape[:2])
    # A scatter-add per code: comparing all codes with all levels is 6 to 13 times slower.
    table = jnp.zeros((boxes, _OUTSIDE + 1), shares.dtype)
    table = table.at[jnp.arange(boxes)[:, None], codes.astype(jnp.int32).reshape(boxes, -1)].add(
        shares.reshape(boxes, -1), mode="promise_in_bounds"
    )
    return jnp.take_along_axis(table.reshape(*levels.shape[:2], -1), levels, axis=-1)
