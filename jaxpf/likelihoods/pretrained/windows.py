"""Square windows around objects, cut from a frame and brought to one size of the object."""

import math

import jax
import jax.numpy as jnp

from jaxpf.lowering.columns import entries_at

#: Height and width of a window, pixels of the window.
SIDE = 256
#: The object's size, the square root of its area, in a window; and its longest side at most.
OBJECT_SIZE, LONGEST = 64.0, 118.0
#: Places per pixel of a window and direction that are averaged.
_PLACES = 2


def zoom_of(width: float, height: float) -> float:
    """Pixels of a window per pixel of the frame, for an object of this size."""
    return min(OBJECT_SIZE / math.sqrt(width * height), LONGEST / max(width, height))


def factor_of(zoom: float) -> int:
    """How often the frame is shrunk before a window is cut: no pixel is skipped up to scale 2."""
    return max(int(1 / zoom), 1)


def window_around(picture: jax.Array, factor: int, centre: jax.Array, zoom: jax.Array) -> jax.Array:
    """A window of a frame, float32 [SIDE, SIDE, 3], 0 to 255; edge pixels go on outside.

    Args:
        picture: the frame shrunk by ``factor``, float32 [h, w, 3].
        factor: pixels of the frame per pixel of the picture.
        centre: [2], x and y in the frame.
        zoom: [], pixels of the window per pixel of the frame.
    """
    offsets = (jnp.arange(SIDE * _PLACES, dtype=jnp.float32) + 0.5) / _PLACES - SIDE / 2

    def along(picture: jax.Array, middle: jax.Array) -> jax.Array:
        """Linear interpolation between rows."""
        places = (middle + offsets / zoom) / factor - 0.5
        places = jnp.clip(places.astype(jnp.float32), 0, len(picture) - 1)
        first = jnp.minimum(places.astype(jnp.int32), max(len(picture) - 2, 0))
        share = (places - first)[:, None, None]
        second = jnp.minimum(first + 1, len(picture) - 1)
        rows = (1 - share) * entries_at(picture, first) + share * entries_at(picture, second)
        return rows.reshape(SIDE, _PLACES, *picture.shape[1:]).mean(axis=1)

    rows = along(picture, centre[1])
    return along(rows.swapaxes(0, 1), centre[0]).swapaxes(0, 1)


def halved(window: jax.Array) -> jax.Array:
    """A window at half the resolution, [SIDE / 2, SIDE / 2, 3]."""
    return window.reshape(SIDE // 2, 2, SIDE // 2, 2, 3).mean(axis=(1, 3))
