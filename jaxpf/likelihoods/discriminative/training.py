"""Learn to separate an object from its surroundings by ridge regression on overlaps.

A box also shows some background, and one frame cannot separate it from the object: a score that
uses both stays with the background when the object moves on.  So the object is also shown in front
of other parts of its frame, where only its own features still predict its position.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.pytree import as_array
from jaxpf.likelihoods._integral import Boxes, boxes_in
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood
from jaxpf.likelihoods.discriminative.pictures import shrunk, size_of
from jaxpf.lowering.programs import compiled

#: Weight of the penalty on the squared coefficients, per background.
RIDGE = 0.5
#: Shifts of the frame behind the object, in widths and heights of its box: none, and shifts so
#: large that an object of less than a sixth of the frame's width has no copy next to it.
BACKGROUNDS = ((0.0, 0.0), (3.2, 0.0), (-3.2, 0.0), (4.1, 0.3), (-4.1, -0.3))
#: Width of the soft edge of the ellipse, inscribed in its box, that represents the object.
_EDGE = 0.15
#: Margin of windows beyond the farthest training box, shrunk pixels: maps use neighbourhoods.
_MARGIN = 8


def training_boxes() -> tuple[np.ndarray, np.ndarray]:
    """Boxes around an object at [0, 1] x [0, 1], and their overlaps with it.

    Small shifts at three sizes, a coarse grid further out, and wrong sizes: 143 boxes.

    Returns:
        [n, 4], x and y of the centre relative to the object's, width and height, all in units of
        the object's width and height; and [n], intersection over union with the object.
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


def before_background(
    frame: jax.Array, box: jax.Array, shift: jax.Array, corner: jax.Array, shape: tuple[int, int]
) -> jax.Array:
    """An object in front of another part of its frame, cropped to a window.

    Inside the ellipse inscribed in the box the frame is kept; elsewhere it is shifted, and wraps
    around at its edges.

    Args:
        frame: uint8 [H, W, 3].
        box: [4], x, y, width and height in pixels.
        shift: [2], to the right and down, in units of the box's width and height.
        corner: int32 [2], left and top of the window.
        shape: height h and width w of the window.

    Returns:
        uint8 [h, w, 3].
    """
    columns, rows = corner[0] + jnp.arange(shape[1]), corner[1] + jnp.arange(shape[0])
    across = (columns.astype(box.dtype) + 0.5 - box[0]) / box[2] * 2 - 1
    down = (rows.astype(box.dtype) + 0.5 - box[1]) / box[3] * 2 - 1
    away = jnp.hypot(across[None, :], down[:, None])
    share = jnp.clip(0.5 + (1 - away) / _EDGE, 0, 1)[..., None]

    def seen(right, lower):
        return frame[(rows - lower)[:, None] % frame.shape[0], (columns - right) % frame.shape[1]]

    behind = seen(*jnp.round(shift * box[2:]).astype(jnp.int32))
    return jnp.round(share * seen(0, 0) + (1 - share) * behind).astype(frame.dtype)


def ridge(
    features: jax.Array, labels: jax.Array, penalty: float = RIDGE
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Coefficients such that ``features @ weights + offset`` is close to the labels.

    Minimises the squared residuals plus ``penalty`` times the squared weights; the offset is not
    penalised.  Solved in the dual, since there are fewer examples than features.

    Args:
        features: [n, F].
        labels: [n].
        penalty: above 0.

    Returns:
        Weights [F], offset [], and the root mean squared residual [].
    """
    middle, level = jnp.mean(features, axis=0), jnp.mean(labels)
    centred = features - middle
    kernel = jnp.matmul(centred, centred.T, precision="highest")
    kernel = kernel + penalty * jnp.eye(len(labels), dtype=features.dtype)
    factor = jax.scipy.linalg.cho_factor(kernel)
    weights = centred.T @ jax.scipy.linalg.cho_solve(factor, labels - level)
    residual = labels - level - centred @ weights
    return weights, level - middle @ weights, jnp.sqrt(jnp.mean(residual**2))


def trained(
    likelihood: DiscriminativeLikelihood, frame: jax.Array, boxes: np.ndarray
) -> DiscriminativeLikelihood:
    """The likelihood with learned coefficients, one object after the other.

    Each object is learned in a window of the shrunken frame that holds all its training boxes.
    All objects share one window shape, rounded up to powers of two, so few programs are compiled.

    Args:
        likelihood: complete except for coefficients, offsets and residuals.
        frame: uint8 [H, W, 3].
        boxes: [P, 4], x, y, width and height in pixels.
    """
    factors = np.array(likelihood.factors)[np.asarray(likelihood.level)]
    shrunk_boxes = boxes / factors[:, None]
    sides = 4 * np.max(shrunk_boxes[:, 2:], axis=0) + 2 * _MARGIN + 1
    columns, rows = (2 ** math.ceil(math.log2(side)) for side in sides)
    coefficients = []
    for number, (box, factor) in enumerate(zip(shrunk_boxes, map(int, factors), strict=True)):
        height, width = size_of((frame.shape[0], frame.shape[1]), factor)
        shape = min(rows, height), min(columns, width)
        first = np.floor(box[:2] - 1.5 * box[2:] - _MARGIN)
        corner = np.clip(first, 0, [width - shape[1], height - shape[0]]).astype(np.int32)
        pictures = _pictures(frame, as_array(boxes[number], float), corner, shape, factor)
        place = as_array(box - [*corner, 0, 0], float)
        coefficients.append(_coefficients(likelihood, number, pictures, place))
    return with_coefficients(likelihood, *map(np.stack, zip(*coefficients, strict=True)))


@functools.partial(compiled, static_argnames=("shape", "factor"))
def _pictures(frame, box, corner, shape, factor):
    """An object's window, shrunk, with each background: [n, h, w, 3]."""
    padding = [(0, -side % factor) for side in frame.shape[:2]]
    frame = jnp.pad(frame, [*padding, (0, 0)], mode="edge")
    whole = (shape[0] * factor, shape[1] * factor)

    def before(shift):
        return shrunk(before_background(frame, box, shift, corner * factor, whole), factor)

    return jax.lax.map(before, jnp.asarray(BACKGROUNDS, box.dtype))


@compiled
def _coefficients(likelihood, number, pictures, box):
    """Coefficients [F], offset and residual of one object, from pictures with its backgrounds."""

    def features(picture, boxes):
        return likelihood.features_of(likelihood.seen_in([picture]), number, boxes)

    return fit(features, pictures, pictures.shape[1:3], box)


def fit(
    features: Callable[[Any, Boxes], jax.Array],
    pictures: Any,
    shape: tuple[int, int],
    box: jax.Array,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """``ridge`` of one object, from its training boxes before every background.

    Args:
        features: function of a picture and boxes in it that returns features [n, F].
        pictures: with each background, a pytree with a leading axis.
        shape: height and width of the pictures.
        box: of the object in the pictures, [4].
    """
    shifts, overlaps = (jnp.asarray(x, box.dtype) for x in training_boxes())
    centres, extents = box[:2] + box[2:] * (0.5 + shifts[:, :2]), box[2:] * shifts[:, 2:3]
    boxes = boxes_in(shape, *(centres - extents / 2).T, *extents.T)
    examples = jax.lax.map(lambda picture: features(picture, boxes), pictures)
    count = len(examples)
    return ridge(jnp.concatenate(examples), jnp.tile(overlaps, count), RIDGE * count)


def with_coefficients(likelihood, weights, offset, residual):
    """The likelihood with coefficients [P, F], offsets [P] and residuals [P]."""
    colours, cells = np.split(weights, [likelihood.colour_weights[0].size], axis=1)
    return dataclasses.replace(
        likelihood,
        offset=as_array(offset),
        residual=as_array(residual),
        colour_weights=as_array(colours.reshape(likelihood.colour_weights.shape)),
        gradient_weights=as_array(cells.reshape(likelihood.gradient_weights.shape)),
    )
