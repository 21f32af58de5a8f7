"""Distribution of the number of features on a line without a target: b(n) of maccormick1999.

It is learned from lines at random places and in random directions of typical frames, or Poisson
with a given mean.  Learned counts are smoothed by a geometric distribution with the same mean, so
that no line has an infinite log-ratio.  Counts above the largest that is kept are added to that
one.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import TINY, check_number
from jaxpf.contract.pytree import as_array
from jaxpf.likelihoods.contours.edges import EdgeDetector, Lines
from jaxpf.lowering.programs import compiled

#: Weight of the geometric distribution, in lines, added to the counts.
_SMOOTHING = 5.0


def poisson_clutter(mean: float, max_features: int) -> jax.Array:
    """b(n) for n = 0 .. max_features of Poisson clutter, ``[max_features + 1]``.

    On lines with fewer than ``max_features`` features, the line model has the ratios of the full
    distribution, ``(L / mean)^k``; a line with ``max_features`` may have shown more.

    Args:
        mean: features per line.
        max_features: the detector's.
    """
    check_number("clutter", mean, above=0)
    counts = np.arange(max_features + 1)
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(counts[1:]))])
    law = np.exp(counts * np.log(mean) - mean - log_factorial)
    if law.min() < np.finfo(np.float32).tiny:
        raise InputError(
            f"clutter of mean {mean:g} features per line makes 0 to {max_features} features "
            "impossible in 32 bits; give a mean between, such as 0.1 to 10."
        )
    return as_array(law, float)


def learn_clutter(frames: ArrayLike, detector: EdgeDetector, *, num_lines: int = 4000) -> jax.Array:
    """b(n) for n = 0 .. max_features from random lines of frames, ``[max_features + 1]``.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``.
        detector: the likelihood's detector.
        num_lines: total number of lines, divided among the frames.
    """
    frames = np.asarray(frames)
    height, width = frames.shape[1:3]
    if min(height, width) <= detector.length:
        raise InputError(
            f"lines of {detector.length} pixels do not fit into frames of {width} x {height}; take "
            "shorter lines."
        )
    rng = np.random.default_rng(0)
    counts = np.zeros(detector.max_features + 1)
    find = compiled(lambda frame, lines: detector.find(detector.observe(frame), lines).present)
    each = -(-num_lines // len(frames))
    for frame in frames:
        angle = rng.uniform(0, np.pi, each)
        reach = detector.reach * np.abs([np.cos(angle), np.sin(angle)])
        x, y = (rng.uniform(r, size - r) for r, size in zip(reach, (width, height), strict=True))
        lines = Lines(*(jnp.asarray(v, jnp.float32) for v in (x, y, np.cos(angle), np.sin(angle))))
        numbers = np.asarray(find(jnp.asarray(frame), lines)).sum(axis=0)
        counts += np.bincount(numbers, minlength=len(counts))
    total = counts.sum()
    mean = counts @ np.arange(len(counts)) / total
    if mean == 0:
        raise InputError(
            f"none of {total:.0f} random lines shows an edge above the threshold "
            f"{float(detector.threshold):g}, so that clutter cannot be learned; lower the "
            "threshold, or give clutter, the mean number of edges on a line."
        )
    geometric = (mean / (1 + mean)) ** np.arange(len(counts))
    smoothed = counts + _SMOOTHING * geometric / geometric.sum()
    return as_array(smoothed / smoothed.sum(), float)


def check_clutter(clutter: ArrayLike) -> jax.Array:
    """Convert b(n); refuse what is not above 0, or sums to more than 1."""
    values = np.asarray(clutter, float)
    if not (values >= TINY).all() or values.sum() > 1 + 1e-5:
        raise InputError(
            f"clutter {values.round(6).tolist()} must be above 0 and sum to 1 or less; smooth it, "
            "as learn_clutter does."
        )
    return as_array(values, float)
