"""Histograms of boxes at any angle that change smoothly with the box.

A box is covered by a grid of n places.  Each place spreads its weight 1 / n over the four pixels
around it with bilinear weights, and each pixel counts in its own bin: colours are not mixed, and
the histogram is continuous in the box.  The weights are linear in the place, and the place is
smooth in position, scale and angle, so the derivative is exact unless a place lies exactly on a
line through pixel centres.
"""

import math

import jax
import jax.numpy as jnp

from jaxpf.likelihoods._places import cell_centres, places_in_image
from jaxpf.likelihoods._sampled import OUTSIDE
from jaxpf.lowering.columns import words_at

#: Distance in pixels between the samples of a group of ``_sampled.sample_table``: adjacent.
NEIGHBOURS = 1
# Entry (i, j) of the table begins with pixel (i - _MARGIN, j - _MARGIN).
_MARGIN = NEIGHBOURS + 1

# A bin with less than this share of a place contributes linearly, not by its root: the slope of
# sqrt(p) is infinite at p = 0, where a bin appears.
_ROUNDED = 0.1


def interpolated_similarity(
    table, num_samples, levels, roots, partition, u, v, width, height, cosine, sine
):
    """Sum over bands of the Bhattacharyya coefficient, for many rotated boxes.

    ``sqrt(p)`` is smoothed at 0: ``p / sqrt(p + e)``, with e a tenth of a place's weight.

    Args:
        table: uint32, ``_sampled.sample_table(bins, NEIGHBOURS)``.
        num_samples: places per side of the box, S.
        levels, roots, partition: as for ``_sampled.sampled_similarity``.
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
    share_of_bin = weight * _counts(codes, shares, levels)
    root = share_of_bin * jax.lax.rsqrt(share_of_bin + _ROUNDED * weight)
    return jnp.sum(root * roots, axis=(1, 2))


def _counts(codes, shares, levels):
    """Sums of the shares per level, [N, bands, K], from codes and shares [N, bands, n, 4]."""
    boxes = math.prod(codes.shape[:2])
    # A scatter-add per code: comparing all codes with all levels is 6 to 13 times slower.
    table = jnp.zeros((boxes, OUTSIDE + 1), shares.dtype)
    table = table.at[jnp.arange(boxes)[:, None], codes.reshape(boxes, -1)].add(
        shares.reshape(boxes, -1), mode="promise_in_bounds"
    )
    return jnp.take_along_axis(table.reshape(*codes.shape[:2], -1), levels, axis=-1)
