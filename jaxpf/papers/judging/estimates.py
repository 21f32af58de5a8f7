"""Estimates with intervals over scenes: means, rates, ratios and differences."""

import math
from typing import Any

import numpy as np

from jaxpf.measures.intervals import difference_interval, mean_interval
from jaxpf.papers.judging.claims import Quantity


def mean_of(
    values: Any,
    what: str = "",
    bounds: tuple[float, float] | None = None,
) -> Quantity:
    """The mean of the scenes' values ``[S]``, ignoring NaN.  See ``mean_interval``."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]

    def interval(level: float) -> tuple[float, float]:
        ends = mean_interval(values, level=level, bounds=bounds)
        return float(ends.lower), float(ends.upper)

    value = float(values.mean()) if len(values) else math.nan
    return Quantity(value, interval, max(len(values), 1), what)


def ratio_of(first: Any, second: Any, what: str = "") -> Quantity:
    """The geometric mean of the scenes' ratios ``[S]``, first over second.

    The arithmetic mean can exceed 1 in either direction of the division.  Scenes with a value that
    is not finite or not positive are excluded.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithms = mean_of(np.log(np.asarray(first, float) / np.asarray(second, float)))

    def interval(level: float) -> tuple[float, float]:
        low, high = logarithms.interval(level)
        return math.exp(low), math.exp(high)

    return logarithms._replace(value=math.exp(logarithms.value), interval=interval, what=what)


def gain_of(ours: Any, base: Any, what: str = "") -> Quantity:
    """By how many per cent the scenes' values ``[S]`` are below others: one less ``ratio_of``."""
    ratio = ratio_of(ours, base, what)

    def interval(level: float) -> tuple[float, float]:
        low, high = ratio.interval(level)
        return 100 * (1 - high), 100 * (1 - low)

    return ratio._replace(value=100 * (1 - ratio.value), interval=interval)


def share_of(trials: Any, what: str = "") -> Quantity:
    """The percentage of successful trials ``[S, trials]`` bool."""
    return mean_of(100 * _by_scene(trials), what, (0.0, 100.0))


def gap_of(first: Any, second: Any, what: str = "") -> Quantity:
    """Difference of two success percentages, ``[S, trials]`` on the same scenes, in points."""
    rates = _by_scene(first), _by_scene(second)

    def interval(level: float) -> tuple[float, float]:
        ends = difference_interval(*rates, level, (0.0, 1.0))
        return 100 * float(ends.lower), 100 * float(ends.upper)

    value = 100 * float(rates[0].mean() - rates[1].mean()) if len(rates[0]) else math.nan
    return Quantity(value, interval, max(len(rates[0]), 1), what)


def _by_scene(trials: Any) -> np.ndarray:
    """The scenes' rates ``[S]``."""
    return np.asarray(trials, float).mean(axis=1)
