"""Estimates with intervals over scenes, alone or paired: means, shares, ratios and gains."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.measures.intervals import difference_interval, mean_interval


class Measured(NamedTuple):
    """A figure and its 95% interval, in the units of its table."""

    value: float
    low: float
    high: float


class Quantity(NamedTuple):
    """One measured figure of a claim.

    Attributes:
        value: the estimate.
        interval: level -> confidence interval (low, high).
        units: number of scenes, or of other units; 0 for a computed, deterministic figure.
        what: description for reports, such as "sharpness 20".
    """

    value: float
    interval: Callable[[float], tuple[float, float]]
    units: int
    what: str = ""

    def measured(self, level: float = 0.95) -> Measured:
        """The figure with its interval."""
        return Measured(self.value, *self.interval(level))

    def scaled(self, function: Callable[[float], float]) -> "Quantity":
        """A monotonic function of the figure."""

        def interval(level: float) -> tuple[float, float]:
            low, high = sorted(map(function, self.interval(level)))
            return low, high

        return self._replace(value=function(self.value), interval=interval)


def computed(value: float, what: str = "") -> Quantity:
    """A computed, deterministic figure."""
    return Quantity(value, lambda level: (value, value), 0, what)


def mean_of(values: Any, what: str = "", bounds: tuple[float, float] | None = None) -> Quantity:
    """The mean of the scenes' values ``[S]``, ignoring NaN.  See ``mean_interval``."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]

    def interval(level: float) -> tuple[float, float]:
        ends = mean_interval(values, level=level, bounds=bounds)
        return float(ends.lower), float(ends.upper)

    value = float(values.mean()) if len(values) else math.nan
    return Quantity(value, interval, max(len(values), 1), what)


def ratio_of(first: ArrayLike, second: ArrayLike, what: str = "") -> Quantity:
    """The geometric mean of the scenes' ratios ``[S]``, first over second.

    The arithmetic mean can exceed 1 in either direction of the division.  Scenes with a value that
    is not finite or not positive are excluded.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithms = np.log(np.asarray(first, float) / np.asarray(second, float))
    return mean_of(logarithms, what).scaled(math.exp)


def gain_of(ours: ArrayLike, base: ArrayLike, what: str = "") -> Quantity:
    """By how many per cent the scenes' values ``[S]`` are below others: one less ``ratio_of``."""
    return ratio_of(ours, base, what).scaled(lambda ratio: 100 * (1 - ratio))


def share_of(rates: ArrayLike, what: str = "") -> Quantity:
    """The percentage of successes, from the scenes' rates ``[S]``."""
    return mean_of(100 * np.asarray(rates, float), what, (0.0, 100.0))


def gap_of(first: ArrayLike, second: ArrayLike, what: str = "") -> Quantity:
    """Difference of two success percentages in points, from the same scenes' rates ``[S]``."""
    rates = np.asarray(first, float), np.asarray(second, float)

    def interval(level: float) -> tuple[float, float]:
        ends = difference_interval(*rates, level, (0.0, 1.0))
        return 100 * float(ends.lower), 100 * float(ends.upper)

    value = 100 * float(rates[0].mean() - rates[1].mean()) if len(rates[0]) else math.nan
    return Quantity(value, interval, max(len(rates[0]), 1), what)


#: Estimates by the kind of a measure, see ``jaxpf.papers.study``: of one variant, and of two.
ALONE: Mapping[str, Callable[..., Quantity]] = {
    "mean": mean_of,
    "percent": share_of,
    "ratio": lambda values, what: ratio_of(values, 1.0, what),
    "gain": mean_of,
}
COMPARED: Mapping[str, Callable[..., Quantity]] = {
    "mean": lambda first, second, what: mean_of(np.subtract(first, second), what),
    "percent": gap_of,
    "ratio": ratio_of,
    "gain": gain_of,
}
