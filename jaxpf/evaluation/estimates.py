"""Estimates and paired differences over the runs of an evaluation.

Runs are the independent units.  Frames and objects of one run are correlated, so they contribute
to its value but do not narrow the interval.  Measures with known bounds are means, the others
medians; see ``jaxpf.measures.intervals``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtr

from jaxpf.measures.intervals import (
    Bounds,
    difference_interval,
    difference_p_value,
    mean_interval,
    median_interval,
)

#: Confidence level of every interval.
LEVEL = 0.95


class Estimate(NamedTuple):
    """A mean or median for each of P objects, and for all objects (last); ``[P + 1]`` each.

    Attributes:
        runs: number of runs that count.
        value: of the runs.
        standard_error: NaN for a single run, and for medians.
        lower: lower end of the interval; NaN with too few runs.
        upper: upper end of the interval.
    """

    runs: np.ndarray
    value: np.ndarray
    standard_error: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class Difference(NamedTuple):
    """A configuration minus its reference, on common seeds; ``[P + 1]`` each as in ``Estimate``.

    Attributes:
        runs: number of pairs that count.
        value: positive if the configuration has the larger values.
        standard_error: of the runs' differences; NaN for medians.
        lower: lower end of the interval.
        upper: upper end of the interval.
        gained: number of runs in which the configuration has the larger value.
        lost: number of runs in which the reference has the larger value.
        p: two-sided p-value for no difference, below 0.05 where the 95% interval excludes 0: of
            rates McNemar's exact test, of medians the sign test.
    """

    runs: np.ndarray
    value: np.ndarray
    standard_error: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    gained: np.ndarray
    lost: np.ndarray
    p: np.ndarray


def with_all(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Append the mean over objects as a last column.

    Args:
        values: ``[R, P]``, NaN where an object does not count.
        weights: ``[R, P]``.

    Returns:
        Values and weights ``[R, P + 1]``; the weights are 0 where the values are not finite.
    """
    weights = np.where(np.isfinite(values), weights, 0.0)
    total = np.sum(weights, axis=1, keepdims=True)
    mass = np.sum(weights * np.where(weights > 0, values, 0.0), axis=1, keepdims=True)
    pooled = np.where(total > 0, mass / np.where(total > 0, total, 1.0), np.nan)
    return np.concatenate([values, pooled], 1), np.concatenate([weights, total], 1)


def estimate(values: np.ndarray, weights: np.ndarray, bounds: Bounds | None) -> Estimate:
    """Means over runs of ``values [R, P]`` with ``weights [R, P]``; medians without bounds."""
    values, weights = with_all(values, weights)
    if bounds is None:
        found = median_interval(np.where(weights > 0, values, np.nan), level=LEVEL)
    else:
        found = mean_interval(values, weights, level=LEVEL, bounds=bounds)
    return Estimate(np.sum(weights > 0, axis=0), *found)


def without_interval(estimate: Estimate) -> Estimate:
    """Drop the intervals, for a tracker that is the same in every run."""
    unknown = np.full_like(estimate.value, np.nan)
    return estimate._replace(standard_error=unknown, lower=unknown, upper=unknown)


def difference(
    ours: tuple[np.ndarray, np.ndarray],
    theirs: tuple[np.ndarray, np.ndarray],
    bounds: Bounds | None,
    level: float = LEVEL,
) -> Difference:
    """Mean difference of paired runs; the median difference without bounds.

    Args:
        ours: values and weights of objects in each run, ``[R, P]`` each.
        theirs: those of the reference in the same runs.
        bounds: smallest and largest possible value, or None.
        level: confidence of the interval.
    """
    first, second = (
        np.where(weights > 0, values, np.nan)
        for values, weights in (with_all(*each) for each in (ours, theirs))
    )
    apart = first - second
    runs = np.sum(np.isfinite(apart), axis=0)
    # Equal values in every run may differ by rounding.
    sizes = np.abs([first, second])
    scale = 1e-12 * np.max(sizes, axis=(0, 1), where=np.isfinite(sizes), initial=0)
    gained, lost = np.sum(apart > scale, axis=0), np.sum(apart < -scale, axis=0)
    if bounds is None:
        found = median_interval(apart, level=level)
        # Runs without a difference count on the other side.
        p = np.minimum(2 * bdtr(runs - np.maximum(gained, lost), runs, 0.5), 1.0)
        p = np.where(runs > 1, p, np.nan)
    else:
        found = difference_interval(first, second, level, bounds)
        p = difference_p_value(first, second, bounds)
    return Difference(runs, *found, gained, lost, p)


def holm(p: ArrayLike) -> np.ndarray:
    """Adjust p-values for a family of comparisons (Holm 1979); NaN entries are not counted."""
    p = np.asarray(p, np.float64)
    adjusted = np.full(p.shape, np.nan)
    finite = np.flatnonzero(np.isfinite(p))
    order = finite[np.argsort(p[finite], kind="stable")]
    factors = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted
