"""Appearance by the features of a pretrained network, beside colours and gradients.

A network that was trained to classify pictures turns a window around each object into maps.  A
box's score is linear in the maps' means over the cells of the box and in the usual features of the
same window at half its resolution (``jaxpf.likelihoods.discriminative``), and is learned from the
start frame in the same way: ridge regression on overlaps, in front of that frame's and other
backgrounds.  With y the score and r the residual of the regression::

    log p(y | x) = sharpness * clip(y, -.2, 1.2) / max(r, .03)

Each object's window is cut around its last estimate and zoomed so that it has the same size in
every frame; so the network sees objects of one size, and the cost of a frame does not depend on its
size.  Particles outside the window score as if nothing were there.  Because windows follow the
estimate, the likelihood of a frame depends on the frames before; it is no density of the frame.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.likelihoods._integral import Boxes, line_before, parts
from jaxpf.likelihoods.discriminative.likelihood import (
    LARGEST,
    DiscriminativeLikelihood,
    LearnedLikelihood,
    check_size,
    grid_places,
)
from jaxpf.likelihoods.discriminative.pictures import shrunk
from jaxpf.lowering.branches import one_by_one
from jaxpf.lowering.columns import entries_at

#: Height and width of a window, pixels of the window.
SIDE = 256
#: The object's size, the square root of its area, in a window; and its longest side at most.
OBJECT_SIZE, LONGEST = 64.0, 118.0
#: Places per pixel of a window and direction that are averaged.
_PLACES = 2
#: Error of the place, in sizes of the object.
_SLIP = 0.1


class Seen(NamedTuple):
    """The observation of a frame.

    Attributes:
        centres: [P, 2], of the windows, in the frame.
        zooms: [P], pixels of each window per pixel of the frame.
        known: the tables of colours and gradients, of all windows.
        scores: for each map of the network, the integral tables of the scores, [P, ...].
    """

    centres: jax.Array
    zooms: jax.Array
    known: Any
    scores: tuple[jax.Array, ...]


def maps_of(network: Callable, window: jax.Array) -> tuple[jax.Array, ...]:
    """A network's maps [h, w, C] of a window, also of a network that returns only one."""
    maps = network(window)
    return tuple(maps) if isinstance(maps, tuple | list) else (maps,)


def _shown(factor, network, layers, picture, centre, zoom):
    """A window at half its resolution, and the integral tables of the scores of its maps."""
    window = window_around(picture, factor, centre, zoom)
    maps = maps_of(network, window / 255)
    tables = [
        score_table((each - middle) / spread, weights)
        for each, (middle, spread, weights) in zip(maps, layers, strict=True)
    ]
    return halved(window), tables


@pytree_dataclass
class PretrainedLikelihood(LearnedLikelihood):
    """Learned appearance of P objects by a network's features; make one with :func:`pretrained`.

    Attributes:
        sharpness: scalar; larger trusts the score more.
        sizes: [P, 2], width and height of the box at scale 1, pixels.
        zooms: [P], pixels of a window per pixel of the frame at scale 1.
        offset: [P], of the score.
        residual: [P], root mean squared residual of the regression.
        known: the likelihood of the usual features in the windows, at half their resolution.
        network: function of a window, float [SIDE, SIDE, 3] from 0 to 1, that returns maps
            [h, w, C]; a pytree.
        weights: for each map, [P, rows, columns, C].
        middles: for each map, [P, C], subtracted from it.
        spreads: for each map, [P, C], by which it is divided then.
        factors: by which the frame is shrunk for each object's window.
        frame_shape: height and width of all frames.
    """

    sharpness: ArrayLike
    sizes: jax.Array
    zooms: jax.Array
    offset: jax.Array
    residual: jax.Array
    known: DiscriminativeLikelihood
    network: Callable
    weights: tuple[Any, ...]
    middles: tuple[jax.Array, ...]
    spreads: tuple[jax.Array, ...]
    factors: tuple[int, ...] = static_field()
    frame_shape: tuple[int, int] = static_field()

    #: Scores of colours and gradients count whole pixels.
    state_gradient = False
    odds = (19.0, 0.25, 0.22)

    @property
    def model_error(self):
        """Of the place a tenth of the size, and of the size a factor of 1.3."""
        side = jnp.sqrt(jnp.prod(jnp.asarray(self.sizes), axis=1))
        of_size = jnp.full_like(side, DiscriminativeLikelihood.model_error[2])
        return jnp.stack([_SLIP * side, _SLIP * side, of_size], axis=1)

    def observe(self, frame):
        """A frame, uint8 RGB [H, W, 3], shrunk for the windows that :meth:`look_near` cuts."""
        check_size(frame, self.frame_shape)
        return {factor: shrunk(jnp.asarray(frame), factor) for factor in set(self.factors)}

    def look_near(self, pictures, estimates):
        """What windows around estimates show.

        Args:
            pictures: of a frame, from :meth:`observe`.
            estimates: [P, 3], of the previous frame.

        Returns:
            A ``Seen``, the observation of all other methods.
        """
        dtype = estimates.dtype
        is_known = jnp.all(jnp.isfinite(estimates), axis=1)
        middle = jnp.asarray(self.frame_shape[::-1], dtype) / 2
        centres = jnp.where(is_known[:, None], estimates[:, :2], middle)
        scale = jnp.where(is_known, jnp.clip(estimates[:, 2], 1 / LARGEST, LARGEST), 1)
        zooms = jnp.asarray(self.zooms, dtype) / scale
        layers = list(zip(self.middles, self.spreads, self.weights, strict=True))
        order: list[int] = []
        shown = []
        for factor in sorted(set(self.factors)):  # one program for all objects of a factor
            own = np.flatnonzero(np.array(self.factors) == factor)
            look = one_by_one(partial(_shown, factor))
            order.extend(own)
            shown.append(
                jax.vmap(look, (None, 0, None, 0, 0))(
                    self.network,
                    jax.tree.map(lambda of, own=own: jnp.asarray(of)[own], layers),
                    pictures[factor],
                    centres[own],
                    zooms[own],
                )
            )
        back = np.argsort(order)
        halves, tables = jax.tree.map(lambda *of: jnp.concatenate(of)[back], *shown)
        known = self.known.seen_in([halves.reshape(-1, *halves.shape[2:])])
        return Seen(centres, zooms, known, tuple(tables))

    def scores_all(self, observation, partition, substates):
        """Scores [N] of substates [3, N], and whether their boxes are valid."""
        if not isinstance(observation, Seen):
            raise InputError(
                "appearance pretrained looks at windows around the last estimate, which this "
                "filter does not pass on; choose sir, ps, dps or sps, or appearance discriminative."
            )
        dtype = substates.dtype
        size = jnp.asarray(self.sizes, dtype)[partition].T * substates[2]
        zoom = observation.zooms.astype(dtype)[partition]
        away = substates[:2] - observation.centres.astype(dtype)[partition].T
        corner = (away - size / 2) * zoom + SIDE / 2
        boxes = jnp.concatenate([corner, size * zoom])
        half = jnp.full_like(partition, SIDE // 2)
        score = jnp.asarray(self.offset, dtype)[partition]
        left, top, width, height = boxes / 2
        halves = Boxes(left, top, width, height, partition * (SIDE // 2), half, half)
        score += self.known.score_of(observation.known, partition, halves)
        for tables, weights in zip(observation.scores, self.weights, strict=True):
            stride = SIDE / (tables.shape[1] - 1)
            score += score_in_boxes(tables, partition, boxes / stride, weights.shape[1:3])
        width, height = size
        valid = (width >= 1) & (height >= 2) & (substates[2] <= LARGEST)
        return score, valid

    def places_elsewhere(self, observation, partition, dtype):
        """A coarse grid over each object's window."""
        steps = (grid_places((SIDE, SIDE), dtype) - SIDE / 2)[:, None]
        zoom = observation.zooms.astype(dtype)[partition]
        return observation.centres.astype(dtype)[partition].T[..., None] + steps / zoom[:, None]


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


def cell_features(maps: jax.Array, boxes: jax.Array, grid: tuple[int, int]) -> jax.Array:
    """Features of boxes, [N, rows, columns, C].

    A feature is a channel's mean over a cell, divided by the square root of the number of cells and
    channels.  Maps keep their sign, unlike histograms: no root is taken.  A cell edge between two
    places of a map counts the place by its share; outside the window maps are zero, the mean.

    Args:
        maps: [h, w, C].
        boxes: [4, N], left, top, width and height, in places of the map.
        grid: rows and columns of cells.
    """
    height, width, channels = maps.shape
    left, top, across, down = boxes
    sums = jnp.einsum(
        "ngh,hwc,nkw->ngkc", _shares(top, down, grid[0], height), maps,
        _shares(left, across, grid[1], width), precision="highest",
    )  # fmt: skip
    return sums / math.sqrt(grid[0] * grid[1] * channels)


def _shares(first: jax.Array, extent: jax.Array, count: int, length: int) -> jax.Array:
    """The weight of each of ``length`` lines in the mean of each of ``count`` cells of a box."""
    edges = jnp.stack(parts(first, extent, count), axis=-1)
    lines = jnp.arange(length)
    last = jnp.minimum(edges[:, 1:, None], lines + 1)
    shared = jnp.maximum(last - jnp.maximum(edges[:, :-1, None], lines), 0)
    return shared / (extent[:, None, None] / count)


def score_table(maps: jax.Array, weights: jax.Array) -> jax.Array:
    """Integral table of each cell's part of the score, [h + 1, w + 1, rows * columns].

    ``score_in_boxes`` of it is ``sum(cell_features * weights)``.

    Args:
        maps: [h, w, C].
        weights: [rows, columns, C].
    """
    scaled = weights.reshape(-1, weights.shape[-1]) / math.sqrt(weights.size)
    parts = jnp.matmul(maps, scaled.T, precision="highest")
    return jnp.pad(parts.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0), (0, 0)))


def score_in_boxes(
    tables: jax.Array, partition: jax.Array, boxes: jax.Array, grid: tuple[int, int]
) -> jax.Array:
    """Scores [N] of boxes.

    Args:
        tables: of P objects, [P, h + 1, w + 1, rows * columns].
        partition: int [N], each box's object.
        boxes: [4, N], left, top, width and height, in places of the maps.
        grid: rows and columns of cells.
    """
    height, width, cells = tables.shape[1] - 1, tables.shape[2] - 1, tables.shape[3]
    flat = tables.reshape(-1)
    cell = jnp.arange(cells).reshape(*grid, 1)
    left, top, across, down = boxes

    def lines(first, extent, count, length):
        """Cell edges within the map."""
        edges = first + extent * (jnp.arange(count + 1)[:, None] / count).astype(first.dtype)
        return line_before(edges, length)

    rows, below = lines(top, down, grid[0], height)
    columns, beyond = lines(left, across, grid[1], width)

    def corners(lower, right):
        """The tables at one corner of every cell, by linear interpolation: [rows, columns, N]."""
        own_rows, own_columns = slice(lower, lower + grid[0]), slice(right, right + grid[1])
        row, column = rows[own_rows, None], columns[None, own_columns]
        place = ((partition * (height + 1) + row) * (width + 1) + column) * cells + cell
        at = [entries_at(flat, place + k * cells) for k in (0, 1, width + 1, width + 2)]
        share = beyond[None, own_columns]
        above, under = (at[k] + share * (at[k + 1] - at[k]) for k in (0, 2))
        return above + below[own_rows, None] * (under - above)

    sums = corners(1, 1) - corners(1, 0) - corners(0, 1) + corners(0, 0)
    area = jnp.maximum(across * down, 1e-6) / cells
    return jnp.sum(sums, axis=(0, 1)) / area
