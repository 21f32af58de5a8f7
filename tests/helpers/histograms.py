"""Colour histograms counted in the plainest way, and frames to count in."""

import jax
import numpy as np

from jaxpf.likelihoods.color import NUM_BINS
from jaxpf.likelihoods.histogram import HistogramLikelihood

HEIGHT, WIDTH = 60, 80


# Compiled as a whole: in tests of many shapes, one compilation per operation is slow.
observe = jax.jit(HistogramLikelihood.observe)
log_prob = jax.jit(HistogramLikelihood.log_prob)
log_prob_all = jax.jit(HistogramLikelihood.log_prob_all)
#: Observation and likelihood in one, for what is asked once of a frame.
log_prob_in_frame = jax.jit(
    lambda likelihood, frame, partition, substates: likelihood.log_prob_all(
        likelihood.observe(frame), partition, substates
    )
)
observe_all = jax.jit(jax.vmap(HistogramLikelihood.observe, in_axes=(None, 0)))

NUM_BOXES = 300


def values(likelihood, observation, partition, substates):
    """Log-likelihoods of up to 300 boxes, filled up to 300: tests then share one program."""
    count = substates.shape[1]
    partition = np.broadcast_to(np.asarray(partition, np.int32), count)
    partition = np.pad(partition, (0, NUM_BOXES - count), mode="edge")
    substates = np.pad(substates, ((0, 0), (0, NUM_BOXES - count)), mode="edge")
    return np.asarray(log_prob_all(likelihood, observation, partition, substates))[:count]


def float_bins(frame):
    """Perez et al.'s bins by the formulas of HSV, float64."""
    color = frame.astype(np.float64) / 255
    red, green, blue = np.moveaxis(color, -1, 0)
    value = color.max(-1)
    chroma = value - color.min(-1)
    saturation = chroma / np.where(value > 0, value, 1)
    safe = np.where(chroma > 0, chroma, 1)
    hue = np.where(
        value == red,
        ((green - blue) / safe) % 6,
        np.where(value == green, (blue - red) / safe + 2, (red - green) / safe + 4),
    )

    def level(x):  # a hair up: 0.7 / 0.1 is not quite 7 in float64
        return np.minimum(np.floor(10 * x + 1e-9), 9).astype(int)

    coloured = (saturation > 0.1 + 1e-12) & (value > 0.2 + 1e-12)
    return np.where(coloured, 10 * level(hue / 6) + level(saturation), 100 + level(value))


def brute_log_prob(frame, references, sizes, partition, substate, sharpness, bands):
    """One box, its pixels counted one band at a time; references [P, bands, 110]."""
    u, v, scale = (float(x) for x in substate)
    width, height = sizes[partition] * scale
    if width < 1 or height < bands:
        return -np.inf
    bins = float_bins(frame)
    left, right = (int(np.floor(x + 0.5)) for x in (u - width / 2, u + width / 2))
    edges = [int(np.floor(v - height / 2 + height * k / bands + 0.5)) for k in range(bands + 1)]
    distance = 0.0
    for k in range(bands):
        inside = bins[max(edges[k], 0) : max(edges[k + 1], 0), max(left, 0) : max(right, 0)]
        count = np.bincount(inside.ravel(), minlength=NUM_BINS)
        p = count / ((right - left) * (edges[k + 1] - edges[k]))
        distance += 1 - np.sqrt(p * references[partition, k]).sum()
    return -sharpness * distance


def noise(seed=0, height=HEIGHT, width=WIDTH):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def texture(seed, height, width, block=4):
    """Coloured blocks."""
    shape = (-(-height // block), -(-width // block), 3)
    small = np.random.default_rng(seed).integers(0, 256, shape)
    return np.kron(small, np.ones((block, block, 1))).astype(np.uint8)[:height, :width]


def full_references(likelihood):
    """References as histograms [P, bands, 110], undoing the compact numbering of bins."""
    roots = np.asarray(likelihood.references, np.float64)
    padded = np.concatenate([roots, np.zeros((*roots.shape[:2], 1))], -1)
    return padded[..., np.asarray(likelihood.bin_lookup)] ** 2


def dyadic(values):
    """Multiples of an eighth: box edges are then exact in float32 and never disagree."""
    return np.round(np.asarray(values) * 8) / 8


def smooth_frame():
    """Noise blurred over about ten pixels: neighbouring pixels share bins, as in a picture."""
    frame = noise(11, 120, 160).astype(float)
    for axis in (0, 1):
        for _ in range(3):
            frame = sum(np.roll(frame, k, axis) for k in range(-2, 3)) / 5
    frame = (frame - frame.min()) / np.ptp(frame) * 255
    return frame.astype(np.uint8)
