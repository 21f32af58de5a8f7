"""Calibration of the particle spread: do credible regions cover the truth at their stated rate?

Each coordinate is scored separately.  Particles are treated as normal, because a run stores only
their mean and standard deviation.  Weighted quantiles of the particles give nearly the same
result: for boxes on seven filmed clips (6 runs of PS), their regions of 50, 80 and 95% cover the
truth in 49, 75 and 90.5% of the frames, and the normal regions in 52, 78 and 90.0%.
"""

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.lost import LOST_BELOW
from jaxpf.measures.intervals import Interval, mean_interval

#: Number of bins in ``confidence_counts``.
CONFIDENCE_BINS = 100


def pit_values(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Probability integral transforms u: predicted probability of values below the truth.

    For a calibrated tracker u is uniform.  Peaks at 0 and 1 mean that the spread is too small, a
    peak in the middle that it is too large (Dawid 1984).  The smallest central region that covers
    the truth has probability ``|2 u - 1|``.

    Args:
        offset: estimate minus truth, any shape.
        spread: standard deviations, of the same shape.

    Returns:
        Values from 0 to 1; NaN if an argument is not finite or the spread is 0.

    Raises:
        InputError: a spread is negative.
    """
    from scipy.special import ndtr

    return ndtr(-_standard(offset, spread))


def smallest_region(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Probability of the smallest central region that covers the truth, ``|2 u - 1|``.

    Arguments and NaN as for ``pit_values``.
    """
    return np.abs(2 * pit_values(offset, spread) - 1)


def crps(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Continuous ranked probability score (CRPS), in the units of the offset; lower is better.

    The score is proper: the true distribution minimises its expectation (Gneiting and Raftery
    2007, eq. 21).  It tends to the absolute error as the spread tends to 0.  Arguments and NaN as
    for ``pit_values``.
    """
    from scipy.special import ndtr

    z = _standard(offset, spread)
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    return np.asarray(spread) * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi))


def log_score(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Log density at the truth; higher is better.  Arguments and NaN as for ``pit_values``."""
    z = _standard(offset, spread)
    return -(z**2) / 2 - np.log(np.where(np.isnan(z), 1, spread) * np.sqrt(2 * np.pi))


def confidence_counts(confidence: ArrayLike, on_object: ArrayLike) -> np.ndarray:
    """Count the frames of every run by confidence and outcome, for ``Reliability``.

    Args:
        confidence: ``[R, ...]`` of R runs, 0 to 1; NaN is left out.
        on_object: ``[R, ...]``, 1 where the estimate is on its object and 0 where it is not; NaN
            is left out.

    Returns:
        int ``[R, 2, 100]``: frames off and on their object, in equal bins of confidence.
    """
    confidence, on_object = np.broadcast_arrays(
        np.asarray(confidence, float),
        np.asarray(on_object, float),
    )
    counts = np.zeros((len(confidence), 2, CONFIDENCE_BINS), np.int64)
    run = np.indices(confidence.shape)[0]
    is_given = np.isfinite(confidence) & np.isfinite(on_object)
    # .29 * 100 is below 29.
    bins = np.round(confidence[is_given] * CONFIDENCE_BINS, 9).astype(int)
    bins = np.minimum(bins, CONFIDENCE_BINS - 1)
    np.add.at(counts, (run[is_given], on_object[is_given].astype(int), bins), 1)
    return counts


class Reliability:
    """Reliability of confidence over runs, from a few counts of each.

    Attributes:
        bins: number B of equal bins of confidence, which divides 100.
        counts: ``[2, 100]``, pooled frames off and on their object, see ``confidence_counts``.
    """

    bins = 5

    def __init__(self) -> None:
        self.counts = np.zeros((2, CONFIDENCE_BINS), np.int64)
        # Of each run: frames off and on their object in each bin, and in all of them.
        self._by_run = np.zeros((0, 2, self.bins + 1), np.int64)

    def add(self, counts: np.ndarray) -> None:
        """Add the ``counts [R, 2, 100]`` of R runs."""
        self.counts += counts.sum(axis=0)
        by_bin = counts.reshape(len(counts), 2, self.bins, -1).sum(axis=-1)
        by_bin = np.concatenate([by_bin, by_bin.sum(axis=-1, keepdims=True)], axis=-1)
        self._by_run = np.concatenate([self._by_run, by_bin])

    @property
    def runs(self) -> np.ndarray:
        """``[B + 1]``: number of runs with frames in each bin, and at all."""
        return (self._by_run.sum(axis=1) > 0).sum(axis=0)

    @property
    def frames(self) -> np.ndarray:
        """``[B + 1]``: number of frames in each bin, and of all."""
        return self._by_run.sum(axis=(0, 1))

    def shares(self) -> Interval:
        """Share of frames on their object in each bin, and of all; ``[B + 1]`` each.

        Confidence is calibrated if the share equals it.  The intervals are over runs, see
        ``mean_interval``; NaN in an empty bin.
        """
        frames, on = self._by_run.sum(axis=1), self._by_run[:, 1]
        return mean_interval(on / np.maximum(frames, 1), frames, bounds=(0.0, 1.0))

    def area(self) -> float:
        """Area under the ROC curve, over all runs.

        It is the probability that a frame on its object has more confidence than one off it; ties
        count half.  NaN unless there are frames of both kinds.
        """
        off, on = self.counts
        pairs = off.sum() * on.sum()
        if not pairs:
            return float("nan")
        below = np.cumsum(off) - off
        return float(np.sum(on * (below + off / 2)) / pairs)

    def silent(self) -> float:
        """Share of all frames off their object without a word: confidence of ``LOST_BELOW`` on."""
        off, frames = self.counts[0], self.counts.sum()
        first = round(LOST_BELOW * CONFIDENCE_BINS)
        return float(off[first:].sum() / frames) if frames else float("nan")


def _standard(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    offset, spread = np.asarray(offset, float), np.asarray(spread, float)
    if (spread < 0).any():
        raise InputError(
            f"spread={np.nanmin(spread):.6g} is negative; give standard deviations, 0 or above."
        )
    is_given = np.isfinite(offset) & np.isfinite(spread) & (spread > 0)
    return np.where(is_given, offset / np.where(is_given, spread, 1), np.nan)
