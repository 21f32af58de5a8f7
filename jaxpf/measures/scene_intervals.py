"""Confidence intervals over independent scenes that hold their level for skewed and bounded data.

Student's interval does not: for means of lognormal errors, or where a tenth of the scenes are lost,
its wrong side is four times as likely as it says.  Here the scenes get random weights (the Bayesian
bootstrap), and one imagined scene is added at each end: at the bound of the figure where it has
one, else beyond the extreme by twice the excess of the longer tail over the shorter.  With bounds
this is Gaffke's interval (2005), which for scenes that fail or succeed is Clopper and Pearson's.
"""

import functools
import math

import numpy as np
from jax.typing import ArrayLike

from jaxpf.measures.intervals import Interval, newcombe_ends

#: Bayesian bootstrap weights that are drawn, and how far beyond the longer tail a scene is added.
_DRAWS, _BEYOND = 4000, 2.0
#: Intervals narrower than this share of their ends have no width but rounding.
_ROUNDING = 1e-6


def scene_interval(
    values: ArrayLike, level: float = 0.95, bounds: tuple[float, float] | None = None
) -> Interval:
    """The mean over scenes with its interval.

    Args:
        values: ``[S]``, one figure per scene; those that are not finite are left out.
        level: confidence, in (0, 1).
        bounds: between which every possible figure lies; None if unknown.

    Returns:
        Scalars; the ends are NaN with fewer than two scenes.
    """
    values = np.asarray(values, float)
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

    Newcombe's method 10 (Statistics in Medicine 1998) from the intervals of both rates and the
    correlation of their scenes.

    Args:
        first: ``[S]``, each scene's rate, 0 to 1.
        second: likewise.
        level: confidence, in (0, 1).

    Returns:
        Scalars; the ends are NaN with fewer than two scenes.
    """
    first, second = np.asarray(first, float), np.asarray(second, float)
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
    """Whether an interval is wider than rounding makes it; False for NaN."""
    return high - low > _ROUNDING * max(abs(low), abs(high))


@functools.cache
def _weights(count: int) -> np.ndarray:
    """Weights ``[draws, count + 1]`` of all scenes and the added one; each row sums to 1."""
    drawn = np.random.default_rng(0).standard_exponential((_DRAWS, count + 1))
    return drawn / drawn.sum(axis=1, keepdims=True)
