"""Discriminative appearance: a score, learned from the start frame, that predicts a box's overlap.

Each object has a linear function of features of a box.  Ridge regression fits it to boxes around
the object in one frame, with their overlaps with the object as labels, in front of that frame's and
other backgrounds (``training``).  With y the score and r the root mean squared residual of the
regression::

    log p(y | x) = sharpness * clip(y, -.2, 1.2) / max(r, .03)

Features are roots of histograms: of the colours of two bands (hue, saturation and value, the
object's 36 most frequent bins), and of brightness gradients in eight directions in 4 x 4 cells
(Dalal and Triggs 2005).  Together they have a length of about root 2.  They are computed from the
frame shrunk so that an object has about 18 to 36 pixels.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike, DTypeLike

from jaxpf.contract import Likelihood
from jaxpf.contract.calls import of_partition
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.likelihoods._integral import (
    Boxes,
    cell_features,
    cell_score,
    integral_table,
    similarity,
    sum_table,
)
from jaxpf.likelihoods.color import check_frame, hsv_bins
from jaxpf.likelihoods.discriminative import nearby
from jaxpf.likelihoods.discriminative.pictures import gradients, regions_of, shrunk, stacked
from jaxpf.shapes.rectangles import area, boxes_from_substates, intersection_area

#: Scores are clipped to this range: labels are overlaps, 0 to 1.
_LOWEST, _HIGHEST = -0.2, 1.2
#: A smaller residual is attributed to chance, since the training boxes are few.
_LEAST_RESIDUAL = 0.03
#: IoU from which two boxes begin to be in one place, and from which they are.
_SAME_PLACE = 0.4, 0.7
#: Largest scale of a box whose pixels can still be counted, see ``pictures.LARGEST_SIDE``.
LARGEST = 8.0


def grid_places(frame_shape: tuple[int, int], dtype: DTypeLike) -> jax.Array:
    """Centres u and v of boxes evenly spread over a frame, pixels, [2, 144]."""
    places = (jnp.arange(nearby.PLACES, dtype=dtype) + 0.5) / nearby.PLACES
    v, u = jnp.meshgrid(places * frame_shape[0], places * frame_shape[1], indexing="ij")
    return jnp.stack([u.ravel(), v.ravel()])


def check_size(frame: Any, frame_shape: tuple[int, int]) -> None:
    """Refuse a frame of another size than the start frame."""
    check_frame(frame)
    if tuple(frame.shape[:2]) != frame_shape:
        (height, width), (rows, columns) = frame.shape[:2], frame_shape
        raise InputError(
            f"a frame of {width} x {height} pixels does not match the start frame of "
            f"{columns} x {rows}, from which appearance was learned; bring all to one size."
        )


def clipped(score: jax.Array) -> jax.Array:
    """A score within the range of overlaps, with some room."""
    return jnp.clip(score, _LOWEST, _HIGHEST)


class LearnedLikelihood(Likelihood):
    """Learned appearance of P objects, from the scores of their boxes.

    A substate is (u, v, a): the centre of the box in pixels from the left and the top of the
    frame, and its scale; the box is ``a * w`` by ``a * h``.  A subclass has the fields
    ``sharpness``, ``sizes`` ``[P, 2]``, ``residual`` ``[P]`` and ``frame_shape``, scores boxes
    (``scores_all``), and says with which others log odds compare them (``places_elsewhere``).
    """

    sharpness: Any
    sizes: Any
    residual: Any
    frame_shape: tuple[int, int]
    #: ``[P, n]``, scores of boxes anywhere, by which the likelihood is normalised; or None.
    background: Any = None
    #: Of the log odds: slope, share of the best score elsewhere, and the score at which they are
    #: zero if all else scores 0.
    odds: tuple[float, float, float]
    #: ``observe`` does not depend on parameters that tuning may change.
    fixed_observation = True

    @property
    def form(self) -> str:
        """``"ratio"`` if the likelihood is normalised, otherwise ``"exponential"``."""
        return "exponential" if self.background is None else "ratio"

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods of N particles.

        Args:
            observation: of a frame.
            partition: int [N], the object each particle's substate belongs to.
            substates: float [D, N].

        Returns:
            [N] in the dtype of ``substates``: NaN where a substate is not finite; -inf for a box
            narrower than 1 pixel, lower than 2, or more than 8 times as large as at the start.
        """
        dtype = substates.dtype
        score, valid = self.scores_all(observation, partition, substates)
        scale = jnp.asarray(self.sharpness, dtype) / jnp.maximum(
            jnp.asarray(self.residual, dtype), _LEAST_RESIDUAL
        )
        log_prob = scale[partition] * clipped(score)
        if self.background is not None:
            usual = scale[:, None] * clipped(self.background.astype(dtype))
            usual = jax.nn.logsumexp(usual, axis=1) - math.log(usual.shape[1])
            log_prob -= usual[partition]
        log_prob = jnp.where(valid, log_prob, -jnp.inf)
        return jnp.where(jnp.all(jnp.isfinite(substates), axis=0), log_prob, jnp.nan)

    def scores_all(self, observation, partition, substates):
        """Scores [N] of particles, estimates of the overlap between box and object; arguments as
        for :meth:`log_prob_all`; and bool [N]: whether the box is neither too small nor too large.
        """
        raise NotImplementedError

    def places_elsewhere(self, observation, partition, dtype):
        """Centres [2, N, n] of boxes with which log odds compare those of N objects."""
        raise NotImplementedError

    def log_odds_all(self, observation, partition, substates):
        """Log odds [N] that objects are where they are reported, by their estimates [D, N].

        A lost object scores low at its reported position, and often better elsewhere.  With y its
        score, e the best score of boxes of its size beside it on a coarse grid, at least 0, and
        ``odds`` of a, b and c, they are ``a (y - b e - c)``.  Look-alikes count as the object.
        """
        places = self.places_elsewhere(observation, partition, substates.dtype)
        elsewhere = jnp.broadcast_to(substates[:, :, None], (len(substates), *places.shape[1:]))
        elsewhere = elsewhere.at[:2].set(places)
        scores = clipped(self.scores_with(observation, partition, substates, elsewhere))
        size = jnp.asarray(self.sizes, substates.dtype)[partition].T * substates[2]
        beside = jnp.any(jnp.abs(places - substates[:2, :, None]) > size[:, :, None], axis=0)
        best = jnp.max(jnp.where(beside, scores[:, 1:], 0.0), axis=1)
        slope, share, level = self.odds
        return slope * (scores[:, 0] - share * best - level)

    def scores_with(self, observation, partition, substates, elsewhere):
        """Scores [N, 1 + n] of substates [D, N], and of others of each object [D, N, n]."""
        every = jnp.concatenate([substates[:, :, None], elsewhere], axis=-1)
        numbers = jnp.repeat(partition, every.shape[-1])
        score, _ = self.scores_all(observation, numbers, every.reshape(len(substates), -1))
        return score.reshape(len(partition), -1)

    def reaches_border(self, partition, substates):
        """Whether boxes ``[D, N]`` reach the frame's border, bool ``[N]``."""
        half = jnp.asarray(self.sizes, substates.dtype)[partition].T * substates[2] / 2
        far = jnp.array(self.frame_shape[::-1], substates.dtype)[:, None]
        places = substates[:2]
        return jnp.any((places <= half) | (places + half >= far), axis=0)

    def same_place(self, partition, substates):
        """How far boxes ``[D, N]`` are in one place, ``[N, N]``: 0 to an IoU of .4, 1 from .7."""
        sizes = jnp.asarray(self.sizes, substates.dtype)[partition]
        boxes = boxes_from_substates(substates[:3].T, sizes)
        shared = intersection_area(boxes[:, None], boxes)
        either = area(boxes)[:, None] + area(boxes) - shared
        least, most = _SAME_PLACE
        return jnp.clip((shared / jnp.maximum(either, 1e-6) - least) / (most - least), 0, 1)


@pytree_dataclass
class DiscriminativeLikelihood(LearnedLikelihood):
    """Learned appearance of P objects; make one with :func:`discriminative`.

    A substate is (u, v, a), see :class:`LearnedLikelihood`, or (u, v, a, b): with b its aspect
    relative to the start, the box is ``a * w * sqrt(b)`` by ``a * h / sqrt(b)``.

    Attributes:
        sharpness: scalar; larger trusts the score more.
        sizes: [P, 2], width and height of the box at scale 1, pixels.
        offset: [P], of the score.
        residual: [P], root mean squared residual of the regression.
        colour_weights: [P, bands, B].
        gradient_weights: [P, rows, columns, 8].
        bin_lookup: int32 [110], colour bin -> one of B bins, or B.
        level: int32 [P], index of each object's level.
        factors: of the levels.
        frame_shape: height and width of all frames.
        interpolation: ``"nearest"`` or ``"bilinear"``, as for histograms.
        background: [P, n], scores of boxes anywhere, by which the likelihood is normalised; or
            None.
        windows: a ``nearby.WindowShape`` for :meth:`observe_nearby`; None for whole frames only.
    """

    sharpness: ArrayLike
    sizes: jax.Array
    offset: jax.Array
    residual: jax.Array
    colour_weights: jax.Array
    gradient_weights: jax.Array
    bin_lookup: jax.Array
    level: jax.Array
    factors: tuple[int, ...] = static_field()
    frame_shape: tuple[int, int] = static_field()
    interpolation: str = static_field(default="nearest")
    background: jax.Array | None = None
    windows: Any = static_field(default=None)

    #: The score hardly depends on the size.
    model_error = (0.0, 0.0, 0.3)
    odds = (11.5, 0.5, 0.12)

    @property
    def state_gradient(self) -> bool:
        """Whether ``log_prob`` is differentiable in the substate."""
        return self.interpolation == "bilinear"

    def observe(self, frame):
        """Tables of a frame, uint8 RGB [H, W, 3]: of colour bins and of gradients, all levels."""
        check_size(frame, self.frame_shape)
        return self.seen_in([shrunk(jnp.asarray(frame), factor) for factor in self.factors])

    def observe_nearby(self, frame, estimates):
        """Tables of the parts of the frame around estimates, or None without windows.

        All methods take them in place of :meth:`observe`'s, with the same results; the score of a
        box that the parts do not contain is NaN.

        Args:
            frame: uint8 RGB [H, W, 3].
            estimates: [P, D], of the previous frame; one of NaN has no part.
        """
        check_size(frame, self.frame_shape)
        return None if self.windows is None else nearby.observe(self, frame, estimates)

    def seen_in(self, pictures):
        """Tables from the frame's shrunken copies, one per level, float [h, w, 3], 0 to 255."""
        num_bins = self.colour_weights.shape[-1]
        bins = stacked([self.colour_bins(picture) for picture in pictures], num_bins)
        maps = stacked([gradients(picture / 255) for picture in pictures], 0)
        return integral_table(bins, num_bins, "uint16"), sum_table(maps)

    def colour_bins(self, picture):
        """Each pixel's bin of B that are used, or B, of a picture, float [h, w, 3], 0 to 255."""
        return self.bin_lookup[hsv_bins(jnp.round(picture).astype(jnp.uint8))]

    def scores_all(self, observation, partition, substates):
        """Scores [N] of substates [3, N] or [4, N], and whether their boxes are valid."""
        boxes, valid = self._boxes(partition, substates)
        if not isinstance(observation, nearby.Nearby):
            return self.score_of(observation, partition, boxes), valid
        boxes, inside = nearby.in_windows(self, observation.corners, partition, boxes)
        score = self.score_of(observation.objects, partition, boxes)
        return jnp.where(inside, score, jnp.nan), valid

    def score_of(self, observation, partition, boxes):
        """Scores [N] of boxes in the picture of all levels."""
        colours, table = observation
        score = jnp.asarray(self.offset, boxes.left.dtype)[partition]
        score += self._colour_score(colours, self.colour_weights, partition, boxes)
        weights = jnp.asarray(self.gradient_weights, score.dtype)
        if self.interpolation == "nearest":
            return score + cell_score(table, weights, partition, boxes)
        cells = cell_features(table, boxes, weights.shape[1:3], self.interpolation)
        return score + jnp.sum(cells * of_partition(weights, partition), axis=(1, 2, 3))

    def places_elsewhere(self, observation, partition, dtype):
        """A coarse grid over the frame, the same for all objects."""
        places = grid_places(self.frame_shape, dtype)[:, None]
        return jnp.broadcast_to(places, (2, len(partition), places.shape[-1]))

    def scores_with(self, observation, partition, substates, elsewhere):
        """Scores [N, 1 + n] of substates [D, N], and of others on the grid [D, N, n]."""
        if not isinstance(observation, nearby.Nearby):
            return super().scores_with(observation, partition, substates, elsewhere)
        score, _ = self.scores_all(observation, partition, substates)
        numbers = jnp.repeat(partition, elsewhere.shape[-1])
        boxes, _ = self._boxes(numbers, elsewhere.reshape(len(substates), -1))
        others = nearby.scores_on_grid(self, observation.elsewhere, partition, boxes)
        return jnp.concatenate([score[:, None], others], axis=1)

    def features_of(self, observation, number, boxes):
        """The features that the scores of one object's boxes are linear in, [N, F].

        Colours first, then the cells of gradients.
        """
        colours, table = observation
        # The score of each bin alone, with unit weight.
        bands, bins = self.colour_weights.shape[1:]
        units = jnp.eye(bands * bins, dtype=boxes.left.dtype).reshape(-1, bands, bins)
        none = jnp.zeros(boxes.left.shape, jnp.int32)
        of_bin = jax.lax.map(
            lambda unit: self._colour_score(colours, unit[None], none, boxes), units
        )
        is_own = jnp.asarray(self.colour_weights)[number].ravel() != 0
        cells = cell_features(table, boxes, self.gradient_weights.shape[1:3], self.interpolation)
        return jnp.concatenate(
            [jnp.where(is_own, of_bin.T, 0), cells.reshape(len(cells), -1)], axis=1
        )

    def _colour_score(self, table, weights, partition, boxes):
        scaled = jnp.asarray(weights) / math.sqrt(weights.shape[1])
        return similarity(table, scaled, partition, boxes, self.interpolation)

    def _boxes(self, partition, substates):
        """Boxes in the picture of all levels, and whether their size is valid."""
        dtype = substates.dtype
        u, v, scale, *aspect = substates
        across = down = scale
        if aspect:
            root = jnp.sqrt(jnp.maximum(aspect[0], 1e-6))
            across, down = scale * root, scale / root
        size = jnp.asarray(self.sizes, dtype)[partition]
        width, height = size[:, 0] * across, size[:, 1] * down
        region = jnp.array(regions_of(self.factors, self.frame_shape), jnp.int32)[self.level]
        factor = jnp.array(self.factors, dtype)[self.level][partition]
        corner = ((u - width / 2) / factor, (v - height / 2) / factor)
        boxes = Boxes(*corner, width / factor, height / factor, *region[partition].T)
        valid = (width >= 1) & (height >= 2) & (scale <= LARGEST)
        return boxes, valid
