"""Confidence intervals over independent units: scenes, clips, or the runs on one clip.

* A mean of bounded values (shares, IoU; ``bounds`` given) is taken as the rate of as many trials as
  its standard error is worth, at Student's degrees of freedom, and has their Clopper and Pearson
  interval (Korn and Graubard, Survey Methodology 24:193, 1998).  For units that fail or succeed
  this is Clopper and Pearson's own; for a spread that is small between the bounds, Student's.
* A mean of unbounded values: Student's interval, corrected for skewness (Hall, Journal of the Royal
  Statistical Society B 54:221, 1992).
* A paired difference: the mean of the differences, between their bounds.  If every value is at one
  of its bounds, the pairs that differ and the gains among them are both counted: the interval
  excludes 0 where McNemar's exact test does.
* A median, for unbounded values of fewer units: order statistics (the inverted sign test).

A p-value is the inversion of the interval: it is below 0.05 where the 95% interval excludes 0.

Below six units the intervals of bounded means are conservative (they cover more often than they
say), with a fifth of a unit at the bounds assumed; with fewer than three there is none (NaN ends).
From six on they show what the units show.  If a tenth of all objects is lost, 11 units include none
of these in 31% of the cases; no interval as narrow as Student's then covers the mean, unless the
spread of the others is wide.  Rare values without a bound may be of any size; therefore an
unbounded mean has no interval below 25 units.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtr, betaincinv, stdtrit

from jaxpf.contract.errors import InputError

Bounds = tuple[float, float]

#: Fewer units than this decide nothing: their results are a preview.
DECISIVE = 10
#: Fewest units with an interval: of bounded values, and of the mean of unbounded ones.
_FEWEST, _FEWEST_UNBOUNDED = 3, 25
#: Assumed units at the bounds, below a number of units and from it on.  The latter keeps equal
#: values from an interval without width, and changes little else.
_CONSERVATIVE_BELOW, _ASSUMED = 6, (0.2, 0.005)
#: Least variance of units at a bound, as a share of the largest possible: shares that are mostly 1
#: say little about the rare ones that are not.
_AT_BOUND = 0.25
#: Intervals narrower than this share of their ends have a width of rounding error only.
_ROUNDING = 1e-6


class Interval(NamedTuple):
    """An estimate with its uncertainty; all four fields have the same shape.

    Attributes:
        value: the mean, the median or the rate.
        standard_error: the estimated standard deviation of ``value``; NaN for a median.
        lower: lower end of the confidence interval; NaN without an interval.
        upper: upper end of the confidence interval.
    """

    value: Any
    standard_error: Any
    lower: Any
    upper: Any


def mean_interval(
    values: ArrayLike,
    weights: ArrayLike | None = None,
    level: float = 0.95,
    bounds: Bounds | None = None,
) -> Interval:
    """A mean over independent units, possibly weighted; see the module's docstring.

    The mean is m = sum_u w_u x_u / sum_u w_u and the squared standard error
    U / (U - 1) sum_u w_u^2 (x_u - m)^2 / (sum_u w_u)^2, which for equal weights is the sample
    variance over U.  With the runs' means as values and their frame counts as weights, m is the
    mean over pooled frames, and the error accounts for the correlation of frames within a run.

    Args:
        values: ``[U, ...]``, the units along the first axis; what is not finite is left out.
        weights: w >= 0, broadcasting with ``values``; equal by default.
        level: confidence, in (0, 1).
        bounds: smallest and largest possible value; None if unknown.

    Returns:
        ``[...]`` each.  The mean of no units is NaN, the error NaN with
        fewer than two; the ends are NaN with fewer than three, without bounds fewer than 25.
    """
    check_level(level)
    weights = 1.0 if weights is None else weights
    sample = _sample(values, weights)
    lower, upper = _ends(sample, _checked(bounds), (1 - level) / 2)
    return Interval(sample.mean[()], sample.error[()], lower[()], upper[()])


def median_interval(values: ArrayLike, level: float = 0.95) -> Interval:
    """The median over independent units with the narrowest order statistics of at least ``level``.

    Arguments and result as for ``mean_interval``; at 95% the ends are NaN below six units.
    """
    check_level(level)
    values, mass, units = _counted(values, 1.0)
    ordered = np.sort(np.where(mass > 0, values, np.inf), axis=0)
    picked = np.full((3, *units.shape), np.nan)
    for count in np.unique(units[units > 0]):
        # Number of order statistics to leave out on either side, minus one.
        rank = np.sum(bdtr(np.arange(count // 2 + 1), count, 0.5) <= (1 - level) / 2) - 1
        middle = (ordered[(count - 1) // 2] + ordered[count // 2]) / 2
        ends = (ordered[rank], ordered[count - 1 - rank]) if rank >= 0 else (np.nan, np.nan)
        picked = np.where(units == count, np.stack(np.broadcast_arrays(middle, *ends)), picked)
    value, lower, upper = picked
    return Interval(value[()], np.full_like(value, np.nan)[()], lower[()], upper[()])


def difference_interval(
    first: ArrayLike, second: ArrayLike, level: float = 0.95, bounds: Bounds | None = None
) -> Interval:
    """The mean difference of two paired values, first minus second.

    Args:
        first: ``[U, ...]``, the units along the first axis; pairs that lack a value are left out.
        second: the other values of the same units.
        level: confidence, in (0, 1).
        bounds: smallest and largest possible value of each; None if unknown.

    Returns:
        ``[...]`` each; NaN ends as for ``mean_interval``.
    """
    check_level(level)
    sample, ends = _paired(first, second, bounds)
    lower, upper = ends((1 - level) / 2)
    return Interval(sample.mean[()], sample.error[()], lower[()], upper[()])


def difference_p_value(
    first: ArrayLike, second: ArrayLike, bounds: Bounds | None = None
) -> np.ndarray:
    """Two-sided p-value for no difference: 1 - the highest level at which 0 is excluded.

    Arguments as for ``difference_interval``, which is inverted.

    Returns:
        ``[...]``; at least 1e-15, and NaN where there is no interval.
    """
    sample, ends = _paired(first, second, bounds)

    def covers_zero(p: ArrayLike) -> np.ndarray:
        lower, upper = ends(np.minimum(p, 1 - _ROUNDING) / 2)
        return (lower <= 0) & (upper >= 0)

    exponent, step = np.full(sample.mean.shape, -15.0), 7.5
    for _ in range(50):
        exponent = exponent + np.where(covers_zero(10 ** (exponent + step)), step, 0.0)
        step /= 2
    p = np.where(covers_zero(1.0), 1.0, 10**exponent)
    return np.where(np.isnan(ends(0.025)[0]), np.nan, p)[()]


def has_width(low: float, high: float) -> bool:
    """Whether an interval is wider than rounding error; False for NaN."""
    return high - low > _ROUNDING * max(abs(low), abs(high))


def check_level(level: float) -> None:
    """Refuse a confidence that is not above 0 and below 1."""
    if not 0 < level < 1:
        raise InputError(f"level={level!r} must be above 0 and below 1, such as 0.95.")


def _checked(bounds: Bounds | None) -> Bounds | None:
    if bounds is None:
        return None
    low, high = bounds
    if not low < high:
        raise InputError(f"bounds={bounds} must be a smaller number and a larger one.")
    return low, high


class _Sample(NamedTuple):
    """Units that count, their number, and their mean with its standard error (NaN if unknown)."""

    values: np.ndarray
    mass: np.ndarray
    units: np.ndarray
    mean: np.ndarray
    error: np.ndarray


def _sample(values: ArrayLike, weights: ArrayLike) -> _Sample:
    values, mass, units = _counted(values, weights)
    total = np.where(units > 0, mass.sum(axis=0), 1.0)
    mean = np.where(units > 0, np.sum(mass * values, axis=0) / total, np.nan)
    squares = np.sum((mass * (values - mean)) ** 2, axis=0) / total**2
    error = np.where(units > 1, np.sqrt(squares * units / np.maximum(units - 1, 1)), np.nan)
    return _Sample(values, mass / total, units, mean, error)


def _ends(sample: _Sample, bounds: Bounds | None, tail: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Ends of a mean's interval of level 1 - 2 ``tail``, which may differ between the means."""
    fewest = _FEWEST_UNBOUNDED if bounds is None else _FEWEST
    ends = _skewed_ends(sample, tail) if bounds is None else _bounded_ends(sample, bounds, tail)
    lower, upper = (np.where(sample.units >= fewest, end, np.nan) for end in ends)
    return lower, upper


def _bounded_ends(
    sample: _Sample, bounds: Bounds, tail: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    low, width = bounds[0], bounds[1] - bounds[0]
    units, rate = np.maximum(sample.units, 2), np.clip((sample.mean - low) / width, 0.0, 1.0)
    at_bounds = np.minimum(sample.values - low, bounds[1] - sample.values) < _ROUNDING * width
    at_bounds = np.sum(sample.mass * at_bounds, axis=0)
    # Variance of the mean, first of trials where a single one has all of the weight.
    single, share = rate * (1 - rate), np.sum(sample.mass**2, axis=0)
    assumed = np.where(units < _CONSERVATIVE_BELOW, *_ASSUMED)
    variance = (units - 1) * (sample.error / width) ** 2 + assumed * share * single
    variance = np.maximum(variance / (units + assumed), _AT_BOUND * at_bounds * share * single)
    alike = single < _ROUNDING
    freedom = (units - 1) / units * np.where(alike, 1, single) / np.where(alike, share, variance)
    trials = 1 + freedom * (_student(freedom, tail) / _student(units - 1, tail)) ** 2
    lower, upper = _clopper_pearson(rate * trials, (1 - rate) * trials, tail)
    return low + width * lower, low + width * upper


def _skewed_ends(sample: _Sample, tail: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    units = np.maximum(sample.units, 3)
    apart = sample.mass * (sample.values - sample.mean)
    apart = apart / np.where(sample.error > 0, sample.error, 1.0)
    skewness = np.sum(apart**3, axis=0) * units**2.5 / (units - 1) / (units - 2)
    skewness = np.where(np.abs(skewness) > _ROUNDING, skewness, _ROUNDING)
    reach = _student(units - 1, tail) / np.sqrt(units)
    ends = []
    for side in (reach, -reach):
        root = np.cbrt(1 + skewness * (side - skewness / (6 * units)))
        ends.append(sample.mean - sample.error * np.sqrt(units) * 3 * (root - 1) / skewness)
    return ends[0], ends[1]


def _paired(
    first: ArrayLike, second: ArrayLike, bounds: Bounds | None
) -> tuple[_Sample, Callable[[ArrayLike], tuple[np.ndarray, np.ndarray]]]:
    """The differences, and tail -> ends of their mean's interval."""
    sample = _sample(np.subtract(first, second, dtype=float), 1.0)
    limits = _checked(bounds)
    if limits is None:
        return sample, lambda tail: _ends(sample, None, tail)
    low, high = limits
    gained, lost = np.sum(sample.values > 0, axis=0), np.sum(sample.values < 0, axis=0)
    at_ends = np.all(
        np.isin(first, limits) & np.isin(second, limits) | (sample.mass == 0), axis=0
    ) & (sample.units >= _FEWEST)

    def ends(tail: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        of_mean = _ends(sample, (low - high, high - low), tail)
        of_shares = _ends_of_shares(gained, lost, sample.units, tail)
        lower, upper = (
            np.where(at_ends, (high - low) * exact, end)
            for exact, end in zip(of_shares, of_mean, strict=True)
        )
        return lower, upper

    return sample, ends


def _ends_of_shares(
    gained: np.ndarray, lost: np.ndarray, pairs: np.ndarray, tail: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the share of gains less that of losses.

    The difference is the share of pairs that differ, times the balance of gains and losses among
    these.  Its end is that of the balance, with the share at its own end: the distances of both
    from the estimate are added as squares.  It has the sign of the balance's end.
    """
    differing = gained + lost
    share = differing / np.maximum(pairs, 1)
    balance = (gained - lost) / np.maximum(differing, 1)
    least, most = _clopper_pearson(differing, pairs - differing, tail)
    ends = []
    for side, rate in zip((-1, 1), _clopper_pearson(gained, lost, tail), strict=True):
        end = 2 * rate - 1
        nearer = np.where(side * end > 0, most, least)
        reach = np.hypot(share * (end - balance), end * (nearer - share))
        ends.append(share * balance + side * reach)
    return ends[0], ends[1]


def _clopper_pearson(
    hits: np.ndarray, misses: np.ndarray, tail: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the interval of a rate; the numbers need not be whole."""

    def least(hits: np.ndarray, misses: np.ndarray) -> np.ndarray:
        return np.where(hits > 0, betaincinv(np.where(hits > 0, hits, 1), misses + 1, tail), 0.0)

    return least(hits, misses), 1 - least(misses, hits)


def _counted(values: ArrayLike, weights: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values and weights ``[U, ...]``, 0 where a unit does not count, and the number that do."""
    values, mass = np.broadcast_arrays(np.asarray(values, float), np.asarray(weights, float))
    counts = np.isfinite(values) & (mass > 0)
    return np.where(counts, values, 0.0), np.where(counts, mass, 0.0), counts.sum(axis=0)


def _student(freedom: np.ndarray, tail: ArrayLike) -> np.ndarray:
    """t with P(T > t) = ``tail`` for Student's T."""
    return -stdtrit(freedom, tail)
