"""Sample the pixels of many windows of one frame on a grid.

Pixel (i, j), row i and column j, is the square [j, j + 1) x [i, i + 1); pixels outside the frame
are black.
"""

import jax.numpy as jnp

from jaxpf.likelihoods._places import cell_centres, places_in_image
from jaxpf.lowering.columns import words_at
from jaxpf.shapes.rectangles import cos_sin


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
