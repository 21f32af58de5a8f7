"""Learn the reference histograms of boxes, and check the inputs."""

import math

import numpy as np

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.ranges import check_ranges
from jaxpf.likelihoods._checks import INTERPOLATIONS
from jaxpf.likelihoods._sampled import LEVEL_LANES
from jaxpf.likelihoods.color import NUM_BINS, check_frame, hsv_bins
from jaxpf.likelihoods.distance_law import FORMS

METHODS = ("integral", "sampled")

#: Largest number of samples per side of a box that fits the counters of ``_sampled``.
_MOST_SAMPLES = 500


def used_levels(references):
    """[P, parts, K]: the bins that each reference uses, in order, padded with B."""
    is_used = references > 0
    num_levels = -(-is_used.sum(axis=-1).max() // LEVEL_LANES) * LEVEL_LANES
    levels = np.where(is_used, np.arange(references.shape[-1]), references.shape[-1])
    return np.sort(levels, axis=-1)[..., :num_levels]


def box_histogram(bins, box, parts, place):
    """Reference [parts, 110] of a box, normalised over its pixels inside the frame."""
    x, y, width, height = box
    rows = np.floor(y + height * np.arange(parts + 1) / parts + 0.5)
    columns = np.floor(np.array([x, x + width]) + 0.5)
    rows = np.clip(rows, 0, bins.shape[0]).astype(int)
    left, right = np.clip(columns, 0, bins.shape[1]).astype(int)
    result = np.zeros((parts, NUM_BINS))
    for k in range(parts):
        inside = bins[rows[k] : rows[k + 1], left:right]
        if inside.size == 0:
            raise InputError(
                f"{place} is {box.tolist()}: its part {k} of {parts} has no pixel inside the "
                f"frame of {bins.shape[1]} x {bins.shape[0]} pixels; move it inside or use fewer "
                "parts."
            )
        result[k] = np.bincount(inside.ravel(), minlength=NUM_BINS) / inside.size
    return result


def patch_histogram(patch, parts, place):
    check_frame(patch, place)
    height, width, _ = patch.shape
    if height < parts:
        raise InputError(
            f"{place} is {height} pixels high: {parts} parts need at least {parts} rows."
        )
    bins = np.asarray(hsv_bins(patch))
    return box_histogram(bins, np.array([0, 0, width, height], float), parts, place)


def check_sizes(sizes, parts, names):
    for name, (width, height) in zip(names, sizes, strict=True):
        if not (math.isfinite(width) and math.isfinite(height)):
            raise InputError(
                f"{name} is {width} pixels wide and {height} high: both must be finite."
            )
        if width < 1 or height < parts:
            raise InputError(
                f"{name} is {width} pixels wide and {height} high: use at least 1 pixel "
                f"of width and {parts} of height, one for each band."
            )


def check_settings(
    sharpness, method, num_particles, samples, num_parts, interpolation, form,
    background_frames,
):  # fmt: skip
    """Reject invalid settings of a histogram likelihood."""
    check_ranges(sharpness=sharpness)
    check_known("method=", method, ("auto", *METHODS))
    check_known("interpolation=", interpolation, INTERPOLATIONS)
    check_known("form=", form, FORMS)
    if form == "ratio" and background_frames is None:
        raise InputError(
            "form is 'ratio', but there is no background_frames: give frames that show what "
            "the background looks like."
        )
    if num_particles is not None:
        check_whole("num_particles", num_particles)
    check_whole("samples", samples)
    if samples < num_parts:
        raise InputError(
            f"samples is {samples}, which leaves a part without samples: use {num_parts} or more."
        )
    if samples > _MOST_SAMPLES:
        raise InputError(f"samples is {samples}: use at most {_MOST_SAMPLES} per side of a box.")
