"""Learn an appearance likelihood by a pretrained network's features from one frame."""

import functools
import math
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array
from jaxpf.likelihoods._checks import shown_as
from jaxpf.likelihoods.color import check_frame
from jaxpf.likelihoods.discriminative.build import check_boxes, check_learned, untrained
from jaxpf.likelihoods.discriminative.pictures import shrunk
from jaxpf.likelihoods.discriminative.training import (
    BACKGROUNDS,
    before_background,
    fit,
    with_coefficients,
)
from jaxpf.likelihoods.pretrained.likelihood import (
    SIDE,
    PretrainedLikelihood,
    cell_features,
    factor_of,
    halved,
    maps_of,
    window_around,
    zoom_of,
)
from jaxpf.likelihoods.pretrained.network import efficientnet_lite0
from jaxpf.lowering.programs import compiled

#: Least spread of a channel, so that one that does not vary is not divided by nothing.
LEAST_SPREAD = 1e-3


def pretrained(
    frame: np.ndarray,
    boxes: ArrayLike,
    *,
    network: Callable | None = None,
    sharpness: float = 1.0,
    names: Sequence[str] | None = None,
) -> PretrainedLikelihood:
    """Learn to distinguish P objects from their surroundings by a network's features as well.

    Args:
        frame: uint8 RGB [H, W, 3].
        boxes: [P, 4], (x, y, w, h) in pixels.
        network: your own network: a function of a window, float [256, 256, 3] of red, green and
            blue from 0 to 1, in which the object has about 64 pixels, that returns maps [h, w, C]
            of any sign, or a tuple of maps.  Flax, Equinox or plain JAX; give
            ``jax.tree_util.Partial(apply, weights)``, so that the weights are not compiled in.
            By default EfficientNet-lite0, with the weights of ``jaxpf[pretrained]``.
        sharpness: trust in the scores; large values make the particles' spread too small.
        names: of the objects, in messages; by default their numbers.
    """
    check_frame(frame)
    boxes = np.asarray(boxes, float)
    check_boxes(boxes, frame.shape[:2], names)
    check_number("sharpness", sharpness, above=0)
    network = as_network(efficientnet_lite0() if network is None else network)
    window = jax.ShapeDtypeStruct((SIDE, SIDE, 3), jnp.float32)
    cells = tuple(_grid(each.shape) for each in jax.eval_shape(maps_of, network, window))
    known = untrained(jnp.asarray(frame), boxes)
    zooms = [zoom_of(*box[2:]) for box in boxes]
    factors = tuple(map(factor_of, zooms))
    learned = []
    for number, (box, zoom, factor) in enumerate(zip(boxes, zooms, factors, strict=True)):
        pictures = _pictures(
            jnp.asarray(frame), as_array(box, float), as_array(zoom, float), factor
        )
        size = box[2:] * zoom / 2  # in the middle of a window at half its resolution
        place = as_array(np.append(SIDE / 4 - size / 2, size), float)
        learned.append(_coefficients(known, number, network, pictures, place, cells))
    weights, offset, residual, middles, spreads = jax.tree.map(lambda *of: np.stack(of), *learned)
    for number, own in enumerate(zip(*jax.tree.leaves((middles, spreads)), strict=True)):
        if not all(np.isfinite(each).all() for each in own):
            shown = shown_as("boxes", len(boxes), names)[number]
            raise InputError(f"the network makes NaN or infinite maps of {shown}.")
    check_learned(residual, names)
    shapes = [(len(boxes), *of, middle.shape[1]) for of, middle in zip(cells, middles, strict=True)]
    usual = known.colour_weights[0].size + known.gradient_weights[0].size
    ends = np.cumsum([usual, *(math.prod(shape[1:]) for shape in shapes)])
    first, *deep = np.split(weights, ends[:-1], axis=1)
    return PretrainedLikelihood(
        sharpness=as_array(sharpness, float),
        sizes=as_array(boxes[:, 2:], float),
        zooms=as_array(zooms, float),
        offset=as_array(offset),
        residual=as_array(residual),
        known=with_coefficients(known, first, np.zeros(len(boxes)), residual),
        network=network,
        weights=tuple(as_array(w.reshape(of)) for w, of in zip(deep, shapes, strict=True)),
        middles=tuple(map(jnp.asarray, middles)),
        spreads=tuple(map(jnp.asarray, spreads)),
        factors=factors,
        frame_shape=(int(frame.shape[0]), int(frame.shape[1])),
    )


def as_network(network: Callable) -> Callable:
    """The network as a function of its arrays: a module may also hold functions and names."""
    leaves, structure = jax.tree.flatten(network)
    is_array = [hasattr(leaf, "dtype") for leaf in leaves]
    if all(is_array):
        return network
    if not any(is_array):
        return jax.tree_util.Partial(network)
    rest = [None if own else leaf for leaf, own in zip(leaves, is_array, strict=True)]

    def apply(arrays, window):
        left = iter(arrays)
        merged = [next(left) if own else x for x, own in zip(rest, is_array, strict=True)]
        return jax.tree.unflatten(structure, merged)(window)

    arrays = [leaf for leaf, own in zip(leaves, is_array, strict=True) if own]
    return jax.tree_util.Partial(apply, arrays)


def _grid(shape: tuple[int, ...]) -> tuple[int, int]:
    """Rows and columns of cells: as many as the object has places in the map, at most four."""
    return (4, 4) if SIDE // shape[0] <= 8 else (3, 3)


@functools.partial(compiled, static_argnames="factor")
def _pictures(frame, box, zoom, factor):
    """The windows of an object with each background, 0 to 255, [n, SIDE, SIDE, 3]."""

    def before(shift):
        corner = jnp.zeros(2, jnp.int32)
        seen = before_background(frame, box, shift, corner, frame.shape[:2])
        return window_around(shrunk(seen, factor), factor, box[:2] + box[2:] / 2, zoom)

    return jax.lax.map(before, jnp.asarray(BACKGROUNDS, box.dtype))


@functools.partial(compiled, static_argnames="cells")
def _coefficients(known, number, network, pictures, box, cells):
    """Coefficients [F], offset and residual of one object, and each map's mean and spread."""
    maps = jax.lax.map(lambda picture: maps_of(network, picture / 255), pictures)
    middles = [jnp.mean(each, axis=(0, 1, 2)) for each in maps]
    spreads = [
        jnp.sqrt(jnp.mean(jnp.var(each, axis=(1, 2)), axis=0)) + LEAST_SPREAD for each in maps
    ]

    def features(seen, boxes):
        picture, maps = seen
        columns = [known.features_of(known.seen_in([halved(picture)]), number, boxes)]
        for each, middle, spread, grid in zip(maps, middles, spreads, cells, strict=True):
            scaled = jnp.stack(boxes[:4]) * (2 * each.shape[0] / SIDE)
            of_cells = cell_features((each - middle) / spread, scaled, grid)
            columns.append(of_cells.reshape(len(boxes.left), -1))
        return jnp.concatenate(columns, axis=1)

    half = SIDE // 2, SIDE // 2
    return *fit(features, (pictures, tuple(maps)), half, box), middles, spreads
