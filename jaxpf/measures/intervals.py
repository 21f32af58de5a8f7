"""Confidence intervals over independent units: scenes, clips, or the runs on one clip.

* A mean of bounded values (shares, IoU; ``bounds`` given): units get random weights (the Bayesian
  bootstrap), and one artificial unit stands at the bound: Gaffke's interval (2005), which for units
  that fail or succeed is Clopper and Pearson's.  Below 12 units it is the wider of this and
  Student's.
* A mean of unbounded values: the artificial unit stands beyond the extreme by twice the excess of
  the longer tail over the shorter, so that skewed errors are covered.  Rare, large values may be
  missing from a small sample altogether; therefore there is no interval below 25 units.
* A median, for unbounded values of fewer units: order statistics (the inverted sign test).
* A paired difference of bounded means: the mean of the differences, with their bounds.  Of 50 or
  more pairs of which at least ten effectively differ: Newcombe's hybrid interval (method 10;
  Statistics in Medicine 17:2635, 1998), which is narrower.

No interval (NaN ends) with fewer units than a method needs, three at least.
"""

import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtr, stdtrit

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_array, check_together, numbers_in
from jaxpf.contract.pytree import is_concrete

Bounds = tuple[float, float]

#: Fewer units than this decide nothing: their results are a preview.
DECISIVE = 10
#: Fewest units with an interval: of bounded values, and of the mean of unbounded ones.
_FEWEST, _FEWEST_UNBOUNDED = 3, 25
#: Below this number of units an interval is at least as wide as Student's.
_STUDENT_BELOW = 12
#: Newcombe's interval is for at least so many pairs, of which so many effectively differ.
_NEWCOMBE_FROM, _DIFFERING = 50, 10
#: Bayesian bootstrap draws, the smallest tail that they resolve, and the most units drawn.
_DRAWS, _SMALLEST_TAIL, _MOST_UNITS = 4000, 0.002, 2000
#: Factor on the excess of the longer tail.
_BEYOND = 2.0
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
    axis: int = 0,
    level: float = 0.95,
    bounds: Bounds | None = None,
) -> Interval:
    """A mean over independent units, possibly weighted; see the module's docstring.

    The mean is m = sum_u w_u x_u / sum_u w_u and the squared standard error
    U / (U - 1) sum_u w_u^2 (x_u - m)^2 / (sum_u w_u)^2, which for equal weights is the sample
    variance over U.  With the runs' means as values and their frame counts as weights, m is the
    mean over pooled frames, and the error accounts for the correlation of frames within a run.

    Args:
        values: ``[..., U, ...]``; values that are not finite are left out.
        weights: w >= 0, broadcasting with ``values``; equal by default.
        axis: the axis of the units.
        level: confidence, in (0, 1).
        bounds: smallest and largest possible value; None if unknown.

    Returns:
        The shape of ``values`` without the axis.  The mean of no units is NaN, the error NaN with
        fewer than two; the ends are NaN with fewer than three, without bounds fewer than 25.
    """
    check_level(level)
    weights = 1.0 if weights is None else weights
    check_together(values=values, weights=weights)
    values, mass, units = _counted(values, weights, axis)
    total = np.where(units > 0, mass.sum(axis=0), 1.0)
    mean = np.sum(mass * values, axis=0) / total
    squares = np.sum((mass * (values - mean)) ** 2, axis=0) / total**2
    error = np.where(units > 1, np.sqrt(squares * units / np.maximum(units - 1, 1)), np.nan)
    if bounds is None:
        low, high = _beyond(values, mass > 0, mean)
    else:
        low, high = (np.full_like(mean, end) for end in _checked(bounds))
    student = _student(units, level) * error
    if len(values) > _MOST_UNITS:  # normal, and the rule of three for what no unit shows
        unseen = -np.log((1 - level) / 2) / np.maximum(units, 1)
        lower = mean - np.hypot(student, unseen * (mean - low))
        upper = mean + np.hypot(student, unseen * (high - mean))
    else:
        lower, upper = _ends(values, mass, mean, (low, high), level)
    few = np.where(units < _STUDENT_BELOW, student, 0.0)
    lower, upper = np.fmin(lower, mean - few), np.fmax(upper, mean + few)
    if bounds is not None:
        lower, upper = np.maximum(lower, low), np.minimum(upper, high)
    known = units >= (_FEWEST_UNBOUNDED if bounds is None else _FEWEST)
    return Interval(
        np.where(units > 0, mean, np.nan)[()],
        error[()],
        np.where(known, lower, np.nan)[()],
        np.where(known, upper, np.nan)[()],
    )


def median_interval(values: ArrayLike, axis: int = 0, level: float = 0.95) -> Interval:
    """The median over independent units with the narrowest order statistics of at least ``level``.

    Arguments and result as for ``mean_interval``; at 95% the ends are NaN below six units.
    """
    check_level(level)
    values, mass, units = _counted(values, 1.0, axis)
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
    check_together(first=first, second=second)
    first, second = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    difference = first - second
    if bounds is None:
        return mean_interval(difference, level=level)
    low, high = _checked(bounds)
    found = mean_interval(difference, level=level, bounds=(low - high, high - low))
    paired = np.isfinite(difference)
    middle = np.abs(difference - median_interval(difference).value)
    middle = np.where(paired, middle, 0.0)
    # As many equal differences from the median would have this ratio of mean to mean square.
    squares = np.sum(middle**2, axis=0)
    differing = np.sum(middle, axis=0) ** 2 / np.where(squares > 0, squares, 1)
    many = (np.sum(paired, axis=0) >= _NEWCOMBE_FROM) & (differing >= _DIFFERING)
    if not np.any(many):
        return found
    first, second = (np.where(paired, x, np.nan) for x in (first, second))
    one, other = (mean_interval(x, level=level, bounds=bounds) for x in (first, second))
    apart = [np.where(paired, x - i.value, 0.0) for x, i in ((first, one), (second, other))]
    product = np.prod([np.sum(x**2, axis=0) for x in apart], axis=0)
    correlation = np.sum(apart[0] * apart[1], axis=0) / np.sqrt(np.where(product > 0, product, 1))

    def reach(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum(a**2 - 2 * correlation * a * b + b**2, 0))

    lower = found.value - reach(one.value - one.lower, other.upper - other.value)
    upper = found.value + reach(one.upper - one.value, other.value - other.lower)
    return found._replace(
        lower=np.where(many, lower, found.lower)[()], upper=np.where(many, upper, found.upper)[()]
    )


def student_interval(values: ArrayLike, level: float = 0.95) -> Interval:
    """A mean with Student's interval, which is right for normal values only.

    Args:
        values: ``[U]``; values that are not finite are left out.
        level: confidence, in (0, 1).

    Returns:
        Scalars; the ends are NaN with fewer than three units.
    """
    check_level(level)
    numbers = numbers_in("values", values, "numbers, [n]")
    value, error, *_ = mean_interval(numbers)
    count = int(np.isfinite(numbers).sum())
    reach = _student(count, level) * error if count >= _FEWEST else np.nan
    return Interval(value, error, value - reach, value + reach)


def has_width(low: float, high: float) -> bool:
    """Whether an interval is wider than rounding error; False for NaN."""
    return high - low > _ROUNDING * max(abs(low), abs(high))


def check_level(level: Any) -> None:
    """Refuse a confidence that is not above 0 and below 1."""
    check_array("level", level, "above 0 and below 1, such as 0.95")
    if not (np.ndim(level) == 0 and 0 < level < 1):
        raise InputError(f"level={level!r} must be above 0 and below 1, such as 0.95.")


def _checked(bounds: Bounds) -> Bounds:
    low, high = numbers_in("bounds", bounds, "the smallest and the largest value, [2]")
    if not low < high:
        raise InputError(f"bounds={bounds} must be a smaller number and a larger one.")
    return low, high


def _counted(
    values: ArrayLike, weights: ArrayLike, axis: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values and weights ``[U, ...]``, 0 where a unit does not count, and the number that do."""
    if not is_concrete(values, weights):
        raise InputError("Intervals are made in NumPy: call them outside of jit, vmap and scan.")
    values, mass = np.broadcast_arrays(np.asarray(values, float), np.asarray(weights, float))
    values, mass = np.moveaxis(values, axis, 0), np.moveaxis(mass, axis, 0)
    counts = np.isfinite(values) & (mass > 0)
    return np.where(counts, values, 0.0), np.where(counts, mass, 0.0), counts.sum(axis=0)


def _student(units: int | np.ndarray, level: float) -> np.ndarray:
    """t with P(|T| < t) = level for Student's T over so many units."""
    return stdtrit(np.maximum(units - 1, 1), 0.5 + level / 2)


def _beyond(
    values: np.ndarray, counts: np.ndarray, mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places of the artificial units of unbounded values."""
    least = np.min(values, axis=0, where=counts, initial=np.inf)
    most = np.max(values, axis=0, where=counts, initial=-np.inf)
    least, most = (np.where(np.isfinite(x), x, mean) for x in (least, most))
    longer = _BEYOND * ((most - mean) - (mean - least))
    return least + np.minimum(longer, 0.0), most + np.maximum(longer, 0.0)


def _ends(
    values: np.ndarray,
    mass: np.ndarray,
    mean: np.ndarray,
    artificial: tuple[np.ndarray, np.ndarray],
    level: float,
) -> list[np.ndarray]:
    """Ends of the bootstrap's interval.

    An artificial unit on either side has the average weight of the others.
    """
    units, tail = (mass > 0).sum(axis=0), (1 - level) / 2
    resolved = max(tail, _SMALLEST_TAIL)
    # Smaller tails than the draws resolve: as much farther as Student's.
    farther = _student(units, level) / _student(units, 1 - 2 * resolved)
    drawn = _exponentials(len(values))
    heavy = mass.reshape(len(mass), mean.size)
    added = drawn[:, -1:] * np.ravel(mass.sum(axis=0) / np.maximum(units, 1))
    total = drawn[:, :-1] @ (heavy * values.reshape(heavy.shape))
    weight = np.maximum(drawn[:, :-1] @ heavy + added, np.finfo(float).tiny)
    ends = []
    for side, place in zip((-1, 1), artificial, strict=True):
        means = (total + added * np.ravel(place)) / weight
        found = np.quantile(means, resolved if side < 0 else 1 - resolved, axis=0)
        reach = np.maximum(side * (found.reshape(mean.shape) - mean), 0) * farther
        ends.append(mean + side * np.minimum(reach, side * (place - mean)))
    return ends


@functools.lru_cache(maxsize=4)
def _exponentials(units: int) -> np.ndarray:
    """Unnormalised bootstrap weights ``[draws, units + 1]``; the last is the artificial unit's."""
    return np.random.default_rng(0).standard_exponential((_DRAWS, units + 1))
