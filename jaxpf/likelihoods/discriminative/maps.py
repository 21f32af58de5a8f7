"""Feature maps: per-pixel features of a picture, to be summed in the cells of a box."""

import jax
import jax.numpy as jnp

#: Number of directions of the brightness gradient, over the full circle.
ORIENTATIONS = 8
_LUMA = (0.299, 0.587, 0.114)


def gradients(picture: jax.Array) -> jax.Array:
    """Strength of the brightness gradient in each of eight directions (Dalal and Triggs 2005).

    A pixel's vote is the square root of the gradient's length, shared between the two nearest
    directions.

    Args:
        picture: float [h, w, 3], red, green, blue, 0 to 1.

    Returns:
        [h, w, 8], 0 to 1.
    """
    grey = picture @ jnp.asarray(_LUMA, picture.dtype)
    padded = jnp.pad(grey, 1, mode="edge")
    across = (padded[1:-1, 2:] - padded[1:-1, :-2]) / 2
    down = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / 2
    length = jnp.sqrt(across**2 + down**2)
    turn = jnp.arctan2(down, across) * (ORIENTATIONS / (2 * jnp.pi))
    away = (turn[..., None] - jnp.arange(ORIENTATIONS) + ORIENTATIONS / 2) % ORIENTATIONS
    share = jnp.maximum(1 - jnp.abs(away - ORIENTATIONS / 2), 0)
    return jnp.sqrt(length)[..., None] * share


def hues(picture: jax.Array) -> jax.Array:
    """Colour of a pixel: shares of four hues, weighted by chroma, and of four greys.

    Hue and chroma are those of HSV (Smith 1978).  Chroma is shared between the two nearest of
    four hues a quarter turn apart, the first of them red; the rest, 1 - chroma, between the two
    nearest of four brightnesses, 0, 1/3, 2/3 and 1.  The eight shares of a pixel add up to 1.

    Args:
        picture: float [h, w, 3], red, green, blue, 0 to 1.

    Returns:
        [h, w, 8], 0 to 1.
    """
    red, green, blue = jnp.moveaxis(picture, -1, 0)
    value = jnp.max(picture, axis=-1)
    chroma = value - jnp.min(picture, axis=-1)
    unit = jnp.where(chroma > 0, chroma, 1.0)
    sixths = jnp.where(
        value == red,
        (green - blue) / unit,
        jnp.where(value == green, 2 + (blue - red) / unit, 4 + (red - green) / unit),
    )
    away = jnp.abs((sixths[..., None] * (4 / 6) - jnp.arange(4) + 2) % 4 - 2)
    apart = jnp.abs(value[..., None] * 3 - jnp.arange(4))
    coloured = jnp.maximum(1 - away, 0) * chroma[..., None]
    grey = jnp.maximum(1 - apart, 0) * (1 - chroma)[..., None]
    return jnp.concatenate([coloured, grey], axis=-1)
