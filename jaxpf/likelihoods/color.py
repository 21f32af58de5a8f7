"""Colour bins in hue, saturation and value (Perez, Hue, Vermaak and Gangnet, ECCV 2002).

A pixel with saturation above 0.1 and value above 0.2 (both on the scale 0 to 1) falls in
one of 10 x 10 hue-saturation bins; every other pixel falls in one of 10 value bins.
"""

import jax
import jax.numpy as jnp

from jaxpf.contract.errors import InputError
from jaxpf.lowering.branches import computed_before
from jaxpf.lowering.programs import compiled

LEVELS = 10
NUM_BINS = LEVELS * LEVELS + LEVELS


def check_frame(frame, name: str = "frame") -> None:
    """Raise InputError unless ``frame`` is non-empty uint8 RGB, [H, W, 3]."""
    shape, dtype = getattr(frame, "shape", None), getattr(frame, "dtype", None)
    if dtype != jnp.uint8 or shape is None or len(shape) != 3 or shape[2] != 3 or 0 in shape:
        shown = type(frame).__name__ if shape is None else f"{dtype} {list(shape)}"
        raise InputError(
            f"{name} is {shown}, but a colour histogram needs RGB pixels, uint8 [H, W, 3]: "
            "convert it first."
        )


@compiled
def hsv_bins(frame) -> jax.Array:
    """The colour bin of every pixel.

    Args:
        frame: uint8 [..., 3], red, green, blue, 0 to 255.

    Returns:
        int32 [...]: ``10 * hue_level + saturation_level`` (0 to 99) for a coloured pixel,
        ``100 + value_level`` for the rest.

    The arithmetic is exact.  With ``chroma = max - min`` as an integer, saturation is
    chroma / max, value is max / 255 and hue is a sixth of an integer over chroma.  So each level
    is the floor of a fraction whose terms stay below 2^14.  Adding half to the numerator cannot
    reach the next integer, and keeps the result right if a device's division is off by a
    rounding error.
    """
    # Planes of floats, and selections between precomputed values, because CPUs vectorise these;
    # interleaved bytes, or selections between expressions, are twice as slow.
    planes = computed_before(jnp.moveaxis(frame, -1, 0).astype(jnp.float32))
    red, green, blue = planes
    largest = jnp.maximum(jnp.maximum(red, green), blue)
    chroma = largest - jnp.minimum(jnp.minimum(red, green), blue)

    # Hue on the colour wheel in sixths of a turn, times chroma: 0 to 6 * chroma.
    is_red, is_green = largest == red, largest == green
    difference = jnp.where(is_red, green - blue, jnp.where(is_green, blue - red, red - green))
    sector = jnp.where(is_red, jnp.where(green < blue, 6.0, 0.0), jnp.where(is_green, 2.0, 4.0))
    sixths = difference + sector * chroma

    top = LEVELS - 1  # saturation 1 and value 1 belong to the last level

    def level(numerator, denominator):
        return jnp.floor(jnp.minimum((LEVELS * numerator + 0.5) / denominator, top))

    hue = level(sixths, jnp.maximum(6 * chroma, 1))
    saturation = level(chroma, jnp.maximum(largest, 1))
    value = level(largest, 255)
    coloured = (10 * chroma > largest) & (5 * largest > 255)
    bins = jnp.where(coloured, LEVELS * hue + saturation, LEVELS * LEVELS + value)
    return bins.astype(jnp.int32)
