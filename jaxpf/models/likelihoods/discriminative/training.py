"""Learning to tell an object from what is around it: ridge regression on overlaps.

A box shows some of what is behind its object too, and in one frame nothing tells the two apart: a
score that counts on both stays behind with the wall when the object walks on.  So the object is
also shown in front of other parts of its frame: what then still tells where it is, is its own.
"""

import jax
import jax.numpy as jnp
import numpy as np

#: Weight of the penalty on the squared coefficients, per background.
RIDGE = 0.5
#: How far the frame is shifted behind the object, in widths and heights of its box: not at all, and
#: so far that an object of less than a sixth of the frame's width has no copy next to it.
BACKGROUNDS = ((0.0, 0.0), (3.2, 0.0), (-3.2, 0.0), (4.1, 0.3), (-4.1, -0.3))
#: Where the object ends and its background begins: an ellipse in its box, with an edge so wide.
_EDGE = 0.15


def training_boxes() -> tuple[np.ndarray, np.ndarray]:
    """Boxes around an object that is [0, 1] x [0, 1], and how much each overlaps it.

    Small shifts at three sizes, a coarse grid further out, and wrong sizes: 143 of them.

    Returns:
        [n, 4], x and y of the centre from the object's, width and height, all in shares of the
        object's width and height; and [n], intersection over union with the object.
    """
    near, far = (-0.3, -0.15, 0.0, 0.15, 0.3), (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)
    beside = ((0.0, 0.0), (-0.15, 0.0), (0.15, 0.0), (0.0, -0.15), (0.0, 0.15))
    rows = [(x, y, s, s) for s in (0.85, 1.0, 1.18) for x in near for y in near]
    rows += [(x, y, 1.0, 1.0) for x in far for y in far if x or y]
    rows += [(x, y, s, s) for s in (0.6, 0.7, 1.4, 1.6) for x, y in beside]
    boxes = np.array(rows)
    low, high = boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2
    shared = np.maximum(np.minimum(high, 0.5) - np.maximum(low, -0.5), 0).prod(axis=1)
    return boxes, shared / (1 + boxes[:, 2:].prod(axis=1) - shared)


def before_background(frame: jax.Array, box: jax.Array, shift: jax.Array) -> jax.Array:
    """An object in front of another part of its frame.

    What lies in the ellipse that fills the box stays; all else is the frame, shifted and, beyond
    its edges, begun anew.

    Args:
        frame: uint8 [H, W, 3].
        box: [4], x, y, width and height in pixels.
        shift: [2], to the right and down, in shares of the box's width and height.

    Returns:
        uint8 [H, W, 3].
    """
    height, width = frame.shape[:2]
    across = (jnp.arange(width, dtype=box.dtype) + 0.5 - box[0]) / box[2] * 2 - 1
    down = (jnp.arange(height, dtype=box.dtype) + 0.5 - box[1]) / box[3] * 2 - 1
    away = jnp.hypot(across[None, :], down[:, None])
    share = jnp.clip(0.5 + (1 - away) / _EDGE, 0, 1)[..., None]
    right, lower = jnp.round(shift * box[2:]).astype(jnp.int32)
    behind = jnp.roll(frame, (lower, right), axis=(0, 1))
    return jnp.round(share * frame + (1 - share) * behind).astype(frame.dtype)


def ridge(
    features: jax.Array, labels: jax.Array, penalty: float = RIDGE
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Coefficients that make ``features @ weights + offset`` close to the labels.

    The minimum of the squared residuals plus ``penalty`` times the squared weights; the offset is
    free.  Solved in the space of the examples, which are fewer than the features.

    Args:
        features: [n, F].
        labels: [n].
        penalty: above 0.

    Returns:
        Weights [F], offset [], and the root of the mean squared residual [].
    """
    middle, level = jnp.mean(features, axis=0), jnp.mean(labels)
    centred = features - middle
    kernel = jnp.matmul(centred, centred.T, precision="highest")
    kernel = kernel + penalty * jnp.eye(len(labels), dtype=features.dtype)
    factor = jax.scipy.linalg.cho_factor(kernel)
    weights = centred.T @ jax.scipy.linalg.cho_solve(factor, labels - level)
    residual = labels - level - centred @ weights
    return weights, level - middle @ weights, jnp.sqrt(jnp.mean(residual**2))
