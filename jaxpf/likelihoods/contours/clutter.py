"""How many features a line shows where there is no target: b(n) of maccormick1999.

Learned from lines at random places, in random directions, of typical frames; what was never seen
gets a little from a geometric law with the same mean, since no line can be worth infinitely much.
Or Poisson with a given mean.  Counts above the largest that is kept count as that one;
``lost_tail`` says how much that is.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array
from jaxpf.likelihoods.contours.edges import EdgeDetector, Lines

#: Lines' worth of the geometric law that are added to what was counted.
SMOOTHING = 5.0


def poisson_clutter(mean: float, max_features: int) -> jax.Array:
    """b(n) for n = 0 .. max_features of Poisson clutter, ``[max_features + 1]``.

    The ratios of the line model are those of the whole law, ``(L / mean)^k``, on lines that show
    fewer than ``max_features``; a line of so many may have shown more.

    Args:
        mean: features per line.
        max_features: the detector's.

    Raises:
        InputError: a mean that is not above 0.
    """
    if not (np.isfinite(mean) and mean > 0):
        raise InputError(f"clutter of mean {mean} features per line must be a number above 0.")
    counts = np.arange(max_features + 1)
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(counts[1:]))])
    return as_array(np.exp(counts * np.log(mean) - mean - log_factorial), float)


def learn_clutter(
    frames: Any,
    detector: EdgeDetector,
    *,
    num_lines: int = 4000,
    smoothing: float = SMOOTHING,
    seed: int = 0,
) -> jax.Array:
    """b(n) for n = 0 .. max_features from random lines of frames, ``[max_features + 1]``.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``.
        detector: that of the likelihood.
        num_lines: in all, shared out over the frames.
        smoothing: lines' worth of a geometric law of the same mean that are added.
        seed: of the places.

    Raises:
        InputError: no frames; frames that no line fits into; no feature on any line.
    """
    frames = np.asarray(frames)
    if frames.ndim != 4 or len(frames) == 0:
        raise InputError(
            f"clutter is learned from frames [T, H, W, 3], not from {list(frames.shape)}."
        )
    height, width = frames.shape[1:3]
    if min(height, width) <= detector.length:
        raise InputError(
            f"lines of {detector.length} pixels do not fit into frames of {width} x {height}; take "
            "shorter lines."
        )
    rng = np.random.default_rng(seed)
    counts = np.zeros(detector.max_features + 1)
    find = jax.jit(lambda frame, lines: detector.find(detector.observe(frame), lines).present)
    each = -(-num_lines // len(frames))
    for frame in frames:
        angle = rng.uniform(0, np.pi, each)
        reach = detector.reach * np.abs([np.cos(angle), np.sin(angle)])
        x, y = (rng.uniform(r, size - r) for r, size in zip(reach, (width, height), strict=True))
        lines = Lines(*(jnp.asarray(v, jnp.float32) for v in (x, y, np.cos(angle), np.sin(angle))))
        found = np.asarray(find(jnp.asarray(frame), lines)).sum(axis=0)
        counts += np.bincount(found, minlength=len(counts))
    total = counts.sum()
    mean = counts @ np.arange(len(counts)) / total
    if mean == 0:
        raise InputError(
            f"none of {total:.0f} random lines shows an edge above the threshold "
            f"{float(detector.threshold):g}, so that clutter cannot be learned; lower the "
            "threshold, or give clutter, the mean number of edges on a line."
        )
    geometric = (mean / (1 + mean)) ** np.arange(len(counts))
    smoothed = counts + smoothing * geometric / geometric.sum()
    return as_array(smoothed / smoothed.sum(), float)


def lost_tail(clutter: Any, num_boundaries: int = 0) -> float:
    """Probability that a line shows more features than are kept.

    Args:
        clutter: b(n), ``[n_max + 1]``.
        num_boundaries: detected boundaries on the line, each a feature more.
    """
    kept = np.asarray(clutter, float)
    return float(1 - kept[: len(kept) - num_boundaries].sum())


def check_clutter(clutter: Any, max_features: int) -> jax.Array:
    """b(n), above 0, for n = 0 .. max_features.

    Raises:
        InputError: another length, or numbers that are not above 0 or sum to more than one.
    """
    values = np.asarray(clutter, float)
    if values.shape != (max_features + 1,):
        raise InputError(
            f"clutter has shape {list(values.shape)}; give b(n) for n = 0 to {max_features}, the "
            "most features that are kept on a line."
        )
    if not (values > 0).all() or values.sum() > 1 + 1e-5:
        raise InputError(
            f"clutter {values.round(6).tolist()} must be above 0 and sum to at most 1; smooth it, "
            "as learn_clutter does."
        )
    return as_array(values, float)
