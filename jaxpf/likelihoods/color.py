"""Colour bins in hue, saturation and value (Perez, Hue, Vermaak and Gangnet, ECCV 2002).

A pixel with saturation above 0.1 and value above 0.2 (both on the scale 0 to 1) falls in
one of 10 x 10 hue-saturation bins; every other pixel falls in one of 10 value bins.
"""

import jax
import jax.numpy as jnp

from jaxpf.errors import InputError

LEVELS = 10
NUM_BINS = LEVELS * LEVELS + LEVELS


def check_frame(frame, name: str = "frame") -> None:
    """Raise InputError unless ``frame`` is uint8 RGB, shape [H, W, 3], with a pixel in it."""
    shape, dtype = getattr(frame, "shape", None), getattr(frame, "dtype", None)
    if dtype != jnp.uint8 or shape is None or len(shape) != 3 or shape[2] != 3 or 0 in shape:
        found = type(frame).__name__ if shape is None else f"{dtype} {list(shape)}"
        raise InputError(
            f"{name} is {found}, but a colour histogram needs RGB pixels, uint8 [H, W, 3]: "
            "convert it first."
        )


@jax.jit
def hsv_bins(frame) -> jax.Array:
    """The colour bin of every pixel.

    Args:
        frame: uint8 [..., 3], red, green, blue, 0 to 255.

    Returns:
        int32 [...]: ``10 * hue_level + saturation_level`` (0 to 99) for a coloured pixel,
        ``100 + value_level`` for the rest.

    The arithmetic is exact.  With ``chroma = max - min`` in whole numbers, saturation is
    chroma / max, value is max / 255 and hue a sixth of a whole number over chroma, so each
    level is the whole part of a fraction whose terms stay below 2^13.  Half is added to the
    numerator: that cannot reach the next whole number, and it keeps the result right where
    a device's division is off by a rounding error.
    """
    red, green, blue = (frame[..., k].astype(jnp.int32) for k in range(3))
    largest = jnp.maximum(jnp.maximum(red, green), blue)
    chroma = largest - jnp.minimum(jnp.minimum(red, green), blue)

    def whole_part(numerator, denominator):
        quotient = (numerator.astype(jnp.float32) + 0.5) / denominator.astype(jnp.float32)
        return quotient.astype(jnp.int32)

    # Hue on the colour wheel, in sixths of a turn, times chroma: 0 to 6 * chroma.
    sixths = jnp.where(
        largest == red,
        green - blue + jnp.where(green < blue, 6 * chroma, 0),
        jnp.where(largest == green, blue - red + 2 * chroma, red - green + 4 * chroma),
    )
    hue = whole_part(LEVELS * sixths, jnp.maximum(6 * chroma, 1))
    saturation = whole_part(LEVELS * chroma, jnp.maximum(largest, 1))
    value = whole_part(LEVELS * largest, jnp.full_like(largest, 255))
    top = LEVELS - 1  # saturation 1 and value 1 belong to the last level
    coloured = (10 * chroma > largest) & (5 * largest > 255)
    return jnp.where(
        coloured,
        LEVELS * jnp.minimum(hue, top) + jnp.minimum(saturation, top),
        LEVELS * LEVELS + jnp.minimum(value, top),
    )
