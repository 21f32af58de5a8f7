"""Learn a discriminative appearance likelihood from one frame."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array
from jaxpf.likelihoods._checks import shown_as
from jaxpf.likelihoods._integral import INTERPOLATIONS, compacted
from jaxpf.likelihoods.color import NUM_BINS, check_frame, hsv_bins
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood, grid_places
from jaxpf.likelihoods.discriminative.nearby import window_shape
from jaxpf.likelihoods.discriminative.pictures import ORIENTATIONS, factor_of, shrunk
from jaxpf.likelihoods.discriminative.training import trained, training_boxes
from jaxpf.lowering.programs import compiled

#: Number of an object's most frequent colour bins that are used.
_NUM_COLOURS = 36
#: Horizontal bands of the colour histograms; rows and columns of cells of gradients.
_BANDS, _GRID = 2, (4, 4)
#: An object that covers more of the frame than this has no background to learn from.
_MOST_OF_FRAME = 0.95
#: Largest acceptable residual of the regression, as a share of the labels' standard deviation.
_MOST_UNEXPLAINED = 0.7


def discriminative(
    frame,
    boxes,
    *,
    sharpness: float = 1.0,
    interpolation: str = "nearest",
    background_frames: np.ndarray | None = None,
    reach: float | None = None,
    names: Sequence[str] | None = None,
) -> DiscriminativeLikelihood:
    """Learn to distinguish P objects from their surroundings, from their boxes in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        boxes: [P, 4], (x, y, w, h) in pixels.
        sharpness: trust in the scores.  Neighbouring cells see the same pixels, so if it is large,
            the particles' spread is too small; see "Sharpness of learned appearance" in
            docs/development/defaults.md.
        interpolation: ``"nearest"``, or ``"bilinear"`` for gradients with respect to substates.
        background_frames: uint8 RGB [n, H, W, 3].  The likelihood is divided by its mean over
            boxes anywhere in these frames, so that its evidence can choose a sharpness.  By default
            it is not normalised.
        reach: if a run tracks one filter, it computes features only in windows around the objects,
            where these are smaller than the frame.  A window reaches this far beyond its object,
            in square roots of the object's area; a particle outside makes the step use the whole
            frame.  None always uses whole frames.
        names: of the objects, in messages; by default their numbers.
    """
    check_frame(frame)
    frame = jnp.asarray(frame)
    boxes = np.asarray(boxes, float)
    if reach is not None:
        check_number("reach", reach, above=0)
    check_boxes(boxes, frame.shape, names)
    check_number("sharpness", sharpness, above=0)
    check_known("interpolation=", interpolation, INTERPOLATIONS)
    likelihood = trained(untrained(frame, boxes, sharpness, interpolation), frame, boxes)
    check_learned(np.asarray(likelihood.residual), names)
    if reach is not None:
        likelihood = dataclasses.replace(likelihood, windows=window_shape(likelihood, reach))
    if background_frames is None:
        return likelihood
    return dataclasses.replace(likelihood, background=_background(likelihood, background_frames))


def untrained(
    frame: jax.Array, boxes: np.ndarray, sharpness: float = 1.0, interpolation: str = "nearest"
) -> DiscriminativeLikelihood:
    """The likelihood before its coefficients are learned; arguments as above."""
    factors, level = np.unique(
        [factor_of(width, height) for width, height in boxes[:, 2:]], return_inverse=True
    )
    lookup, own = _own_bins(frame, boxes, factors[level])
    return DiscriminativeLikelihood(
        sharpness=as_array(sharpness, float),
        sizes=as_array(boxes[:, 2:], float),
        offset=as_array(np.zeros(len(boxes)), float),
        residual=as_array(np.ones(len(boxes)), float),
        colour_weights=as_array(own, float),
        gradient_weights=as_array(np.ones((len(boxes), *_GRID, ORIENTATIONS)), float),
        bin_lookup=lookup,
        level=as_array(level, jnp.int32),
        factors=tuple(int(factor) for factor in factors),
        frame_shape=(int(frame.shape[0]), int(frame.shape[1])),
        interpolation=interpolation,
    )


def _own_bins(frame, boxes, factors) -> tuple[jax.Array, np.ndarray]:
    """Lookup from colour bin to one of B bins that occur, and a mask of each object's own bins."""
    kept = np.zeros((len(boxes), _BANDS, NUM_BINS), bool)
    for factor in np.unique(factors):
        picture = jnp.round(shrunk(frame, int(factor))).astype(jnp.uint8)
        bins = np.asarray(hsv_bins(picture))
        for place in np.flatnonzero(factors == factor):
            corners = (boxes[place].reshape(2, 2) / factor).cumsum(axis=0)
            (left, top), (right, bottom) = np.clip(
                np.floor(corners + 0.5), 0, bins.shape[::-1]
            ).astype(int)
            inside = bins[top : max(bottom, top + 1), left : max(right, left + 1)]
            counts = np.bincount(inside.ravel(), minlength=NUM_BINS)
            most = np.argsort(-counts, kind="stable")[:_NUM_COLOURS]
            kept[place, :, most[counts[most] > 0]] = True
    return compacted(kept)


@compiled
def _background(likelihood, frames):
    """Scores [P, n] of boxes of every object's size, evenly spread over frames [n, H, W, 3]."""
    places = grid_places(likelihood.frame_shape, likelihood.sizes.dtype)
    substates = jnp.concatenate([places, jnp.ones_like(places[:1])])

    def of_frame(frame):
        seen = likelihood.observe(frame)

        def of_object(number):
            partition = jnp.full(substates.shape[1], number)
            return likelihood.scores_all(seen, partition, substates)[0]

        return jax.vmap(of_object)(jnp.arange(len(likelihood.sizes)))

    scores = jax.lax.map(of_frame, frames)
    return jnp.moveaxis(scores, 0, 1).reshape(len(likelihood.sizes), -1)


def check_learned(residuals: np.ndarray, names: Sequence[str] | None) -> None:
    """Reject objects that look like their surroundings."""
    spread, shown = training_boxes()[1].std(), shown_as("boxes", len(residuals), names)
    for i in np.flatnonzero(~(residuals < _MOST_UNEXPLAINED * spread)):
        raise InputError(
            f"{shown[i]} looks like what is around it, so that it cannot be located; give a "
            "box whose edges show, or another start frame."
        )


def check_boxes(
    boxes: np.ndarray, frame_shape: tuple[int, ...], names: Sequence[str] | None
) -> None:
    """Reject boxes from which no appearance can be learned."""
    height, width = frame_shape[:2]
    for name, box in zip(shown_as("boxes", len(boxes), names), boxes, strict=True):
        x, y, w, h = box
        if not (w >= 4 and h >= 4):
            raise InputError(
                f"{name} is {w:g} pixels wide and {h:g} high: appearance is learned from "
                "objects of at least 4 x 4 pixels; enlarge the frames, or choose the appearance "
                "colour."
            )
        inside = max(min(x + w, width) - max(x, 0), 0) * max(min(y + h, height) - max(y, 0), 0)
        if inside > _MOST_OF_FRAME * width * height:
            raise InputError(
                f"{name} is {box.tolist()}: it fills the frame of {width} x {height} pixels, "
                "so that nothing is left to distinguish it from; choose the appearance colour."
            )
        if inside < 0.25 * w * h:
            raise InputError(
                f"{name} is {box.tolist()}: less than a quarter of it lies in the frame of "
                f"{width} x {height} pixels; start where more of the object is seen."
            )
