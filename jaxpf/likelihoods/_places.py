"""Positions in the image of the samples of rotated boxes, and the colours there.

Pixel (i, j), row i and column j, is the square [j, j + 1) x [i, i + 1); pixels outside the frame
are black.
"""

import jax
import jax.numpy as jnp

from jaxpf.lowering.columns import words_at
from jaxpf.shapes.rectangles import cos_sin


def line_before(place: jax.Array, last) -> tuple[jax.Array, jax.Array]:
    """The line at or before a position clipped to 0 to ``last``, int32, and the share beyond it.

    The line is at most ``last - 1``, so that a next one exists; the share has a derivative.
    """
    place = jnp.clip(place, 0, last)
    line = jnp.clip(jnp.floor(jax.lax.stop_gradient(place)), 0, jnp.maximum(last - 1, 0))
    return line.astype(jnp.int32), place - line


def cell_centres(columns: int, rows: int) -> tuple[jax.Array, jax.Array]:
    """Centres of a grid's cells, row by row, as shares of a box: ``[G]`` each, -1/2 to 1/2."""
    across = jnp.tile((jnp.arange(columns) + 0.5) / columns - 0.5, rows)
    down = jnp.repeat((jnp.arange(rows) + 0.5) / rows - 0.5, columns)
    return across, down


def places_in_image(across, down, u, v, width, height, cosine, sine):
    """Image coordinates x and y, ``[N, G]`` each, of G places in every box.

    Args:
        across: [G], offset from the box's centre as a share of the width.
        down: [G], the same of the height.
        u: [N], centre, pixels from the left.
        v: [N], centre, pixels from the top.
        width: [N], pixels.
        height: [N], pixels.
        cosine: [N], of the rotation, clockwise in the image.
        sine: [N].
    """
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


def window_colours(observation, u, v, width, height, theta, window):
    """Colours at the grid places of every window: [N, rows * columns, 3]."""
    across, down = cell_centres(*window)
    x, y = places_in_image(across, down, u, v, width, height, *cos_sin(theta))
    num_rows, num_columns = observation.shape

    # The table's first row and column are the black margin.
    row = jnp.clip(jnp.floor(y) + 1, 0, num_rows - 1).astype(jnp.int32)
    column = jnp.clip(jnp.floor(x) + 1, 0, num_columns - 1).astype(jnp.int32)
    shifts = jnp.array([0, 8, 16], jnp.uint32)
    return ((words_at(observation, row, column)[..., None] >> shifts) & 255).astype(x.dtype)
