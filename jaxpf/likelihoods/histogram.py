"""Colour-histogram likelihood of horizontal bands.

A box is divided into horizontal bands of equal height.  Each band's histogram p of
hue, saturation and value (Perez et al. 2002, see ``color``) is
compared with a reference q (smith2004, section on the observation model)::

    log p(y | x) = -sharpness * d^2,   d^2 = sum over bands of (1 - sum_b sqrt(p_b q_b))

A box (x, y, w, h) covers [x, x + w) x [y, y + h) in pixels; pixel (i, j), row i and column
j, is the square [j, j + 1) x [i, i + 1).  Pixels outside the frame are in no bin, but p is
divided by the area of the whole box.  So a box that leaves the frame loses similarity smoothly,
and a box outside it has d^2 = bands.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_number, check_whole
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import shown_as, sizes_in
from jaxpf.likelihoods._integral import (
    INTERPOLATIONS,
    boxes_in,
    compacted,
    counts_fit,
    integral_table,
    similarity,
)
from jaxpf.likelihoods._sampled import (
    LEVEL_LANES,
    NEIGHBOURS,
    Turned,
    group_distance,
    sample_table,
    sampled_similarity,
)
from jaxpf.likelihoods.color import NUM_BINS, check_frame, hsv_bins
from jaxpf.likelihoods.distance_law import FORMS, learn_background, log_density
from jaxpf.lowering.programs import compiled

#: Number of runs assumed to share an integral table when the method is chosen.  It is fixed, since
#: the choice affects results, and results must not depend on the number of runs.
_SHARING_RUNS = 25
#: Particles per run where the number is left open.
_USUAL_PARTICLES = 300
METHODS = ("integral", "sampled")
#: Largest number of samples per side of a box that fits the counters of ``_sampled``, and of
#: objects that come and go.
_MOST_SAMPLES, _MOST_OBJECTS = 500, 4096


@pytree_dataclass
class HistogramLikelihood(Likelihood):
    """Colour-histogram likelihood of P objects; make one with :func:`histogram`.

    A substate is (u, v, a): the centre of the box in pixels from the left and the top of
    the frame, and its scale; the box is ``a * w`` by ``a * h``.  With the sampled method it
    may be (u, v, a, theta, ...): theta is the rotation in radians, clockwise in the image;
    further coordinates are ignored.

    Attributes:
        sharpness: scalar, lambda of smith2004.
        references: [P, bands, B], square roots of the reference histograms.
        sizes: [P, 2], width and height of the box at scale 1, pixels.
        bin_lookup: int32 [110], colour bin -> one of B bins, or B for bins that no reference
            uses; these are not counted, since they add nothing to the similarity.
        method: ``"integral"`` (upright boxes, corners at whole pixels) or ``"sampled"``
            (about ``samples x samples`` pixels of a box at any angle).
        samples: samples per side of the box.
        table_dtype: ``"uint16"`` or ``"uint32"``.  Counts wrap around: a box with a band of
            2^16 (2^32) or more pixels in the frame gets log-probability -inf.
        levels: int32 [P, bands, K], for the sampled method: the bins that each reference uses,
            padded with B.
        distance: for the sampled method: pixels between the samples of a group of four.
        interpolation: ``"nearest"`` counts whole pixels: the value is piecewise constant, so
            its gradient with respect to the substate is 0.  ``"bilinear"`` counts fractions of
            pixels and has a correct gradient, at about 7 times the cost for the integral method
            and 16 times for the sampled one.
        form: ``"exponential"``, ``"density"`` or ``"ratio"``, see
            ``distance_law``.
        background: [P, 2, n], for the form ``"ratio"``, see ``learn_background``.
    """

    sharpness: ArrayLike
    references: jax.Array
    sizes: jax.Array
    bin_lookup: jax.Array
    method: str = static_field(default="integral")
    samples: int = static_field(default=16)
    table_dtype: str = static_field(default="uint16")
    levels: Any = None
    distance: int = static_field(default=1)
    interpolation: str = static_field(default="nearest")
    form: str = static_field(default="exponential")
    background: jax.Array | None = None

    #: ``observe`` does not depend on parameters that tuning may change.
    fixed_observation = True

    @property
    def state_gradient(self) -> bool:
        """Whether ``log_prob`` is differentiable in the substate."""
        return self.interpolation == "bilinear"

    def observe(self, frame):
        """The part of the computation that depends only on the frame, shared by particles and runs.

        Args:
            frame: uint8 RGB [H, W, 3].

        Returns:
            integral: a table of counts, unsigned [H + 1, W + 1, B]; sampled: the bins of four
            pixels in every entry, uint32 [H + distance + 2, W + distance + 2].
        """
        check_frame(frame)
        bins = self.bin_lookup[hsv_bins(frame)]
        if self.method == "sampled":
            return sample_table(bins, self.distance)
        return integral_table(bins, self.references.shape[-1], self.table_dtype)

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods of N particles.

        Args:
            observation: what :meth:`observe` returned.
            partition: int [N], the object each particle's substate belongs to.
            substates: float [D, N], (u, v, a) or, sampled, (u, v, a, theta).

        Returns:
            [N] in the dtype of ``substates``: NaN where a substate is not finite; -inf for a
            box under one pixel wide, or with a band under one pixel high.
        """
        squared, valid = self.squared_distance_all(observation, partition, substates)
        dtype = substates.dtype
        log_prob = log_density(
            self.form,
            jnp.asarray(self.sharpness, dtype),
            self.references.shape[1],
            self.background,
            partition,
            squared,
        )
        log_prob = jnp.where(valid, log_prob, -jnp.inf)
        return jnp.where(jnp.all(jnp.isfinite(substates), axis=0), log_prob, jnp.nan)

    def squared_distance_all(self, observation, partition, substates):
        """Squared distances d^2 of N particles to their objects' references.

        Args:
            observation, partition, substates: as for :meth:`log_prob_all`.

        Returns:
            [N], 0 to the number of bands, and bool [N]: whether the box is large enough, and small
            enough for its counts to fit the table.
        """
        u, v, scale = substates[:3] if self.method == "sampled" else substates
        size = jnp.asarray(self.sizes, substates.dtype)[partition]
        width, height = size[:, 0] * scale, size[:, 1] * scale
        num_bands = self.references.shape[1]
        valid = (width >= 1) & (height >= num_bands)
        if self.method == "sampled":
            theta = substates[3] if substates.shape[0] > 3 else jnp.zeros_like(u)
            levels, roots = self._compact_references()
            found = sampled_similarity(
                observation, self.distance, self.samples, levels, roots, partition,
                Turned(u, v, width, height, theta), self.interpolation,
            )  # fmt: skip
        else:
            rows, columns = observation.cells.shape[-3:-1]
            corner = u - width / 2, v - height / 2
            boxes = boxes_in((rows - 1, columns - 1), *corner, width, height)
            references = jnp.asarray(self.references)
            found = similarity(observation, references, partition, boxes, self.interpolation)
            valid &= counts_fit(observation, boxes, num_bands)
        return num_bands - found, valid

    def _compact_references(self):
        """The bins that each reference uses and its values in them, [P, bands, K] each."""
        padded = jnp.pad(jnp.asarray(self.references), ((0, 0), (0, 0), (0, 1)))
        levels = jnp.asarray(self.levels)
        return levels, jnp.take_along_axis(padded, levels, axis=-1)


def histogram(
    frame,
    boxes,
    *,
    sharpness: float = 20.0,
    bands: int = 2,
    method: str = "auto",
    num_particles: int | None = None,
    samples: int = 16,
    interpolation: str = "nearest",
    form: str = "exponential",
    names: Sequence[str] | None = None,
) -> HistogramLikelihood:
    """Learn the likelihood of P objects from their boxes in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        boxes: [P, 4], (x, y, w, h) in pixels.  A reference is normalised over the pixels inside
            the frame.
        sharpness: lambda of smith2004 (20 to 50 there).
        bands: horizontal bands of equal height.
        method: ``"integral"``, ``"sampled"``, or ``"auto"``: integral with bilinear
            interpolation, or if 25 runs together have more than one particle and object per two
            pixels; the result's ``method`` holds the choice.  The sampled method's d^2 is biased
            upwards by about (K - 1) / (8 n) per band, with K bins and n samples, so name a
            method if results are to be compared.
        num_particles: particles per run, for ``"auto"``; default 300.
        samples: samples per side of a box, for the sampled method.
        interpolation: ``"nearest"``, or ``"bilinear"`` for gradients with respect to substates.
        form: ``"exponential"``, ``"density"`` or ``"ratio"``, see
            ``distance_law``; the ratio's background is learned from
            boxes anywhere in ``frame``.
        names: of the objects, in messages; by default their numbers.
    """
    check_frame(frame)
    check_whole("bands", bands)
    boxes = np.asarray(boxes, float)
    names = shown_as("boxes", len(boxes), names)
    sizes = sizes_in(boxes[:, 2:], names, bands)
    bins = np.asarray(hsv_bins(frame))
    learned = [_histogram(bins, *each, bands) for each in zip(names, boxes, strict=True)]
    return _build(
        learned, sizes, sharpness, method, num_particles, samples, bins.shape, interpolation, form,
        frame,
    )  # fmt: skip


def histogram_from_patches(
    patches: Sequence[np.ndarray],
    sizes=None,
    *,
    sharpness: float = 20.0,
    bands: int = 2,
    method: str = "auto",
    num_particles: int | None = None,
    samples: int = 16,
    frame_shape: tuple[int, int] = (288, 360),
    interpolation: str = "nearest",
    form: str = "exponential",
    background_frames: np.ndarray | None = None,
    names: Sequence[str] | None = None,
) -> HistogramLikelihood:
    """Learn the likelihood of P objects from one picture of each.

    Args:
        patches: P pictures, uint8 RGB [h, w, 3], of any sizes.
        sizes: [P, 2], width and height of the boxes at scale 1, pixels; by default the
            sizes of the patches.
        frame_shape: height and width of the frames to track in, for ``method="auto"``.
        sharpness, bands, method, num_particles, samples, interpolation, form, names: as in
            :func:`histogram`.
        background_frames: uint8 RGB [H, W, 3], from which ``form="ratio"`` learns the background.
    """
    check_whole("bands", bands)
    learned, whole = [], [(patch.shape[1], patch.shape[0]) for patch in patches]
    shown = shown_as("patches", len(patches), names)
    for patch, size, name in zip(patches, whole, shown, strict=True):
        check_frame(patch, name)
        learned.append(_histogram(np.asarray(hsv_bins(patch)), name, [0, 0, *size], bands))
    sizes = whole if sizes is None else sizes
    return _build(
        learned, sizes_in(sizes, shown_as("sizes", len(patches), names), bands), sharpness, method,
        num_particles, samples, frame_shape, interpolation, form, background_frames,
    )  # fmt: skip


def open_histogram(
    capacity: int,
    frame_shape: tuple[int, int],
    *,
    typical_size: tuple[float, float] = (32.0, 64.0),
    sharpness: float = 20.0,
    bands: int = 2,
    method: str = "auto",
    num_particles: int | None = None,
) -> HistogramLikelihood:
    """A likelihood with places for P objects that appear later, filled by ``with_object``.

    All colour bins are counted, since a new object may have any.  The shapes of arrays depend only
    on P, so objects come and go without recompilation.

    Args:
        capacity: P.
        frame_shape: height and width of the frames.
        typical_size: width and height of a typical object in pixels, which set the spacing of
            samples.
        sharpness, bands: as in ``histogram``.
        method: ``"integral"``, ``"sampled"`` or ``"auto"``, which means sampled except for huge
            particle sets, as all bins are counted.
        num_particles: of all objects together, for ``"auto"``.
    """
    check_whole("capacity", capacity, most=_MOST_OBJECTS)
    check_whole("bands", bands)
    every = [np.full((bands, NUM_BINS), 1 / NUM_BINS)]
    likelihood = _build(every, [typical_size], sharpness, method, num_particles, 16, frame_shape)
    return dataclasses.replace(
        likelihood,
        references=jnp.zeros((capacity, *likelihood.references.shape[1:])),
        sizes=jnp.ones((capacity, 2)),
        table_dtype="uint32",
        levels=None if likelihood.levels is None else jnp.tile(likelihood.levels, (capacity, 1, 1)),
    )


def with_object(
    likelihood: HistogramLikelihood, place: int, frame: np.ndarray, box: ArrayLike
) -> HistogramLikelihood:
    """The likelihood with an object, learned from a box in a frame, in one place.

    Args:
        likelihood: from ``open_histogram``.
        place: 0 to P - 1.
        frame: uint8 RGB [H, W, 3].
        box: x, y, w, h in pixels; pixels outside the frame are ignored.
    """
    check_frame(frame)
    check_whole("place", place, 0, len(likelihood.references) - 1)
    _, bands, num_bins = likelihood.references.shape
    box = np.asarray(box, float)
    sizes_in(box[None, 2:], ["the box"], bands)
    learned = np.sqrt(_histogram(np.asarray(hsv_bins(frame)), "the box", box, bands))
    learned = np.pad(learned, ((0, 0), (0, num_bins - NUM_BINS)))
    return _replaced(likelihood, place, learned, box[2:])


@compiled
def _replaced(likelihood, place, reference, size):
    references, sizes = likelihood.references, likelihood.sizes
    return dataclasses.replace(
        likelihood,
        references=references.at[place].set(reference.astype(references.dtype)),
        sizes=sizes.at[place].set(size.astype(sizes.dtype)),
    )


def _build(
    histograms, sizes, sharpness, method, num_particles, samples, frame_shape,
    interpolation="nearest", form="exponential", background_frames=None,
) -> HistogramLikelihood:  # fmt: skip
    """Keep the bins that references use, choose the method, and make the likelihood."""
    learned, num_particles = np.array(histograms), num_particles or _USUAL_PARTICLES
    num_objects, num_bands, _ = learned.shape
    check_number("sharpness", sharpness, above=0)
    check_known("method=", method, ("auto", *METHODS))
    check_known("interpolation=", interpolation, INTERPOLATIONS)
    check_known("form=", form, FORMS)
    check_whole("num_particles", num_particles)
    check_whole("samples", samples, num_bands, _MOST_SAMPLES)
    bin_lookup, compact = compacted(np.sqrt(learned))
    is_bilinear = interpolation == "bilinear"
    if method == "auto":
        queries = num_objects * num_particles * _SHARING_RUNS
        is_dense = 2 * queries > math.prod(frame_shape) or is_bilinear
        method = "integral" if is_dense else "sampled"
    is_sampled, distance = method == "sampled", NEIGHBOURS
    if is_sampled and not is_bilinear:
        distance = group_distance(samples, num_bands, sizes)
    # Leave room for twice the size: four times the pixels of a band must not wrap.
    largest_band = max(width * math.ceil(height / num_bands) for width, height in sizes)
    likelihood = HistogramLikelihood(
        sharpness=as_array(sharpness, float),
        references=as_array(compact, float),
        sizes=as_array(sizes, float),
        bin_lookup=bin_lookup,
        method=method,
        samples=samples,
        table_dtype="uint16" if 4 * largest_band < 2**16 else "uint32",
        levels=as_array(_used_levels(compact), jnp.int32) if is_sampled else None,
        distance=distance,
        interpolation=interpolation,
        form="exponential" if form == "ratio" else form,
    )
    if form != "ratio":
        return likelihood
    background = learn_background(likelihood, background_frames)
    return dataclasses.replace(likelihood, form=form, background=background)


def _used_levels(references):
    """[P, bands, K]: the bins that each reference uses, in order, padded with B."""
    is_used = references > 0
    num_levels = -(-is_used.sum(axis=-1).max() // LEVEL_LANES) * LEVEL_LANES
    levels = np.where(is_used, np.arange(references.shape[-1]), references.shape[-1])
    return np.sort(levels, axis=-1)[..., :num_levels]


def _histogram(bins, name, box, bands):
    """Reference [bands, 110] of a box, normalised over its pixels inside the frame."""
    x, y, width, height = box
    rows = np.floor(y + height * np.arange(bands + 1) / bands + 0.5)
    columns = np.floor(np.array([x, x + width]) + 0.5)
    rows = np.clip(rows, 0, bins.shape[0]).astype(int)
    left, right = np.clip(columns, 0, bins.shape[1]).astype(int)
    result = np.zeros((bands, NUM_BINS))
    for k in range(bands):
        inside = bins[rows[k] : rows[k + 1], left:right]
        if inside.size == 0:
            raise InputError(
                f"{name} is {np.asarray(box, float).tolist()}: its band {k} of {bands} has no "
                f"pixel inside the frame of {bins.shape[1]} x {bins.shape[0]} pixels; move it "
                "inside or use fewer bands."
            )
        result[k] = np.bincount(inside.ravel(), minlength=NUM_BINS) / inside.size
    return result
