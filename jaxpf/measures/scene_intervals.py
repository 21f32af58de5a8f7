"""Confidence intervals over independent scenes that keep their level for skewed or bounded data.

Student's interval does not: for means of lognormal errors, or if a tenth of the scenes are lost, it
misses on one side four times as often as stated.  Here scenes get random weights (the Bayesian
bootstrap), and one artificial scene is added at each end: at the bound if there is one, otherwise
beyond the extreme by twice the excess of the longer tail over the shorter.  With bounds this is
Gaffke's interval (2005); for scenes that fail or succeed it is Clopper and Pearson's.
"""

import functools
import math

import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import numbers_in
from jaxpf.measures.intervals import Interval, check_level, newcombe_ends

#: Number of Bayesian bootstrap draws, and the factor on the excess of the longer tail.
_DRAWS, _BEYOND = 4000, 2.0
#: Intervals narrower than this share of their ends have a width of rounding error only.
_ROUNDING = 1e-6


def scene_interval(
    values: ArrayLike, level: float = 0.95, bounds: tuple[float, float] | None = None
) -> Interval:
    """The mean over scenes with its interval.

    Args:
        values: ``[S]``, one value per scene; values that are not finite are left out.
        level: confidence, in (0, 1).
        bounds: smallest and largest possible value; None if unknown.

    Returns:
        Scalars; the ends are NaN with fewer than two scenes.

    Raises:
        InputError: the level is not above 0 and below 1.
    """
    check_level(level)
    values = numbers_in("values", values, "one value per scene, [S]")
    if bounds is not None:
        low, high = numbers_in("bounds", bounds, "the smallest and the largest value, [2]")
        if not low < high:
            raise InputError(f"bounds={bounds} must be a smaller number and a larger one.")
    values = values[np.isfinite(values)]
    count = len(values)
    if count < 2:
        return Interval(values.mean() if count else math.nan, math.nan, math.nan, math.nan)
    mean, least, most = values.mean(), values.min(), values.max()
    longer = _BEYOND * ((most - mean) - (mean - least))
    low_end, high_end = bounds or (least + min(longer, 0.0), most + max(longer, 0.0))
    weights = _weights(count)
    means, added = weights[:, :-1] @ values, weights[:, -1]
    tail = (1 - level) / 2
    return Interval(
        mean,
        values.std(ddof=1) / math.sqrt(count),
        max(min(np.quantile(means + added * low_end, tail), mean), low_end),
        min(max(np.quantile(means + added * high_end, 1 - tail), mean), high_end),
    )


def paired_rates_interval(first: ArrayLike, second: ArrayLike, level: float = 0.95) -> Interval:
    """The difference of two rates on the same scenes, first minus second.

    Newcombe's method 10 (Statistics in Medicine 1998), from the intervals of both rates and their
    correlation over scenes.

    Args:
        first: ``[S]``, each scene's rate, 0 to 1.
        second: ``[S]``, the other rate on the same scenes.
        level: confidence, in (0, 1).

    Returns:
        Scalars; the ends are NaN with fewer than two scenes.
    """
    first = numbers_in("first", first, "one rate per scene, [S]")
    second = numbers_in("second", second, f"one rate per scene, [{len(first)}]")
    if len(first) < 2:
        return scene_interval(first - second)
    both = [scene_interval(rates, level, (0.0, 1.0)) for rates in (first, second)]
    varies = np.ptp(first) > 0 and np.ptp(second) > 0
    correlation = float(np.corrcoef(first, second)[0, 1]) if varies else 0.0
    one, other = ((rate.value, rate.lower, rate.upper) for rate in both)
    ends = newcombe_ends(one, other, correlation)
    error = (first - second).std(ddof=1) / math.sqrt(len(first))
    return Interval(both[0].value - both[1].value, error, *ends)


def has_width(low: float, high: float) -> bool:
    """Whether an interval is wider than rounding error; False for NaN."""
    return high - low > _ROUNDING * max(abs(low), abs(high))


@functools.cache
def _weights(count: int) -> np.ndarray:
    """Bootstrap weights ``[draws, count + 1]``; the last is the added scene's; rows sum to 1."""
    drawn = np.random.default_rng(0).standard_exponential((_DRAWS, count + 1))
    return drawn / drawn.sum(axis=1, keepdims=True)
