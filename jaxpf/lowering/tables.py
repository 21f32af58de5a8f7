"""Integral tables: sums above and to the left of each pixel, in each device's fastest way."""

from collections.abc import Callable

import jax
import jax.numpy as jnp


def sums_above_and_left(pixels: jax.Array, channels: Callable[[jax.Array], jax.Array]) -> jax.Array:
    """Running sums over rows and columns, of integers that may wrap around.

    Args:
        pixels: ``[H, W, ...]``.
        channels: maps one pixel or all pixels to channels ``[..., C]``.  Evaluated while summing,
            because an image of all channels may be tens of times as large as that of the pixels.

    Returns:
        ``[H, W, C]``, sums over all pixels above and to the left, including the pixel itself.
    """
    return jax.lax.platform_dependent(
        pixels,
        cpu=lambda image: _row_by_row(image, channels),
        default=lambda image: _at_once(image, channels),
    )


def _row_by_row(pixels, channels):
    """Two nested scans: on a CPU, a row's running sums stay in registers and cache."""
    template = jax.eval_shape(channels, pixels[0, 0])

    def add_row(above, row):
        def add_pixel(total, pixel):
            here, sum_above = pixel
            total = total + channels(here)
            return total, sum_above + total

        _, sums = jax.lax.scan(add_pixel, jnp.zeros(template.shape, template.dtype), (row, above))
        return sums, sums

    start = jnp.zeros((pixels.shape[1], *template.shape), template.dtype)
    return jax.lax.scan(add_row, start, pixels)[1]


def _at_once(pixels, channels):
    """Two cumulative sums, one large operation each, for a device with many threads."""
    values = channels(pixels)
    return jnp.cumsum(jnp.cumsum(values, axis=1, dtype=values.dtype), axis=0, dtype=values.dtype)
