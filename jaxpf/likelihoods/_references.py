"""Learn the reference histograms of boxes."""

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.likelihoods._sampled import LEVEL_LANES
from jaxpf.likelihoods.color import NUM_BINS, check_frame, hsv_bins


def used_levels(references):
    """[P, bands, K]: the bins that each reference uses, in order, padded with B."""
    is_used = references > 0
    num_levels = -(-is_used.sum(axis=-1).max() // LEVEL_LANES) * LEVEL_LANES
    levels = np.where(is_used, np.arange(references.shape[-1]), references.shape[-1])
    return np.sort(levels, axis=-1)[..., :num_levels]


def box_histogram(bins, box, bands, place):
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
                f"{place} is {box.tolist()}: its band {k} of {bands} has no pixel inside the "
                f"frame of {bins.shape[1]} x {bins.shape[0]} pixels; move it inside or use fewer "
                "bands."
            )
        result[k] = np.bincount(inside.ravel(), minlength=NUM_BINS) / inside.size
    return result


def patch_histogram(patch, bands, place):
    check_frame(patch, place)
    height, width, _ = patch.shape
    if height < bands:
        raise InputError(
            f"{place} is {height} pixels high: {bands} bands need at least {bands} rows."
        )
    bins = np.asarray(hsv_bins(patch))
    return box_histogram(bins, np.array([0, 0, width, height], float), bands, place)
