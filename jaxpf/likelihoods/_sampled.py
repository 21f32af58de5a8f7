"""Histograms of boxes at any angle, from a grid of sampled pixels.

With n samples of a part whose pixels fall in K bins, the sampled d^2 is too large by about
(K - 1) / (8 n) per part (less as n nears the number of pixels), and scatters around that by
far less.  The bias is nearly the same for every particle, so it hardly changes the weights.
Measured on blurred noise with 88 bins, a box of 32 x 42 pixels in two parts, particles 4
pixels from the object: bias 0.14, 0.043, 0.013, 0.001 and standard deviation 0.021, 0.011,
0.006, 0.004 of d^2 at 16, 24, 32 and 64 samples per side.
"""

import jax
import jax.numpy as jnp


def sampled_similarity(bins, num_samples, references, partition, u, v, width, height, cosine, sine):
    """Sum over parts of the Bhattacharyya coefficient, for many rotated boxes.

    Args:
        bins: integer [H, W]; a pixel whose bin is B or more is counted nowhere.
        num_samples: samples per side of the box, S.  Each part gets ceil(S / parts) rows.
        references: [P, parts, B], square roots of the reference histograms.
        partition: int [N].
        u: [N], centre, pixels from the left.
        v: [N], centre, pixels from the top.
        width: [N], pixels.
        height: [N], pixels.
        cosine: [N], of the rotation, clockwise in the image.
        sine: [N].

    Returns:
        Similarity [N].
    """
    num_rows, num_columns = bins.shape
    _, num_parts, num_bins = references.shape
    dtype = u.dtype
    rows_per_part = -(-num_samples // num_parts)
    num_grid_rows = rows_per_part * num_parts
    # Samples sit at the centres of a grid's cells: fractions of the box, -1/2 to 1/2.
    across = ((jnp.arange(num_samples) + 0.5) / num_samples - 0.5).astype(dtype)
    down = ((jnp.arange(num_grid_rows) + 0.5) / num_grid_rows - 0.5).astype(dtype)
    a, b = width[:, None, None] * across, height[:, None, None] * down[:, None]
    cosine, sine = cosine[:, None, None], sine[:, None, None]
    x = jnp.floor(u[:, None, None] + cosine * a - sine * b)
    y = jnp.floor(v[:, None, None] + sine * a + cosine * b)
    inside = (x >= 0) & (x < num_columns) & (y >= 0) & (y < num_rows)
    x = jnp.clip(x, 0, num_columns - 1).astype(jnp.int32)
    y = jnp.clip(y, 0, num_rows - 1).astype(jnp.int32)
    pixels = bins.reshape(-1).at[y * num_columns + x]
    sample = pixels.get(mode="promise_in_bounds", wrap_negative_indices=False)
    sample = jnp.where(inside, sample, num_bins)

    counts = _counts(sample.reshape(-1, num_parts, rows_per_part, num_samples), num_bins)
    root = jnp.sqrt(counts.astype(dtype) / (rows_per_part * num_samples))
    product = (root * references.astype(dtype)[partition]).reshape(-1, num_parts * num_bins)
    return jnp.dot(product, jnp.ones(num_parts * num_bins, dtype))


def _counts(sample, num_bins):
    """Histograms [N, parts, B] of samples [N, parts, rows, columns].

    Every sample is compared with every bin, a row of samples at a time: compares and adds
    of small integers, many to a register.  A scatter-add does less work, but under ``vmap``
    it becomes a scalar loop, ten times slower on a CPU.
    """
    num_rows, num_columns = sample.shape[2:]
    dtype = jnp.uint8 if num_rows * num_columns < 2**8 else jnp.uint16
    levels = jnp.arange(num_bins, dtype=sample.dtype)

    def add_row(i, counts):
        row = jax.lax.dynamic_index_in_dim(sample, i, 2, keepdims=False)
        for j in range(num_columns):
            counts += (row[..., j, None] == levels).astype(dtype)
        return counts

    start = jnp.zeros((*sample.shape[:2], num_bins), dtype)
    return jax.lax.fori_loop(0, num_rows, add_row, start)
