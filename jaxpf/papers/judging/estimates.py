"""Estimates with intervals over scenes, alone or paired: means, shares, ratios and gains."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

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


def mean_of(
    first: ArrayLike,
    second: ArrayLike | None = None,
    what: str = "",
    bounds: tuple[float, float] | None = None,
) -> Quantity:
    """The mean of the scenes' values ``[S]``, or of their differences, ignoring NaN."""
    values = np.asarray(first if second is None else np.subtract(first, second), float)
    values = values[np.isfinite(values)]

    def interval(level: float) -> tuple[float, float]:
        ends = mean_interval(values, level=level, bounds=bounds)
        return float(ends.lower), float(ends.upper)

    value = float(values.mean()) if len(values) else math.nan
    return Quantity(value, interval, max(len(values), 1), what)


def share_of(first: ArrayLike, second: ArrayLike | None = None, what: str = "") -> Quantity:
    """The percentage of successes, from the scenes' rates ``[S]``, or the difference of two."""
    if second is None:
        return mean_of(100 * np.asarray(first, float), None, what, (0.0, 100.0))
    rates = np.asarray(first, float), np.asarray(second, float)

    def interval(level: float) -> tuple[float, float]:
        ends = difference_interval(*rates, level, (0.0, 1.0))
        return 100 * float(ends.lower), 100 * float(ends.upper)

    value = 100 * float(rates[0].mean() - rates[1].mean()) if len(rates[0]) else math.nan
    return Quantity(value, interval, max(len(rates[0]), 1), what)


def ratio_of(first: ArrayLike, second: ArrayLike | None = None, what: str = "") -> Quantity:
    """The geometric mean of the scenes' ratios ``[S]``, first over second, or to 1.

    The arithmetic mean can exceed 1 in either direction of the division.  Scenes with a value that
    is not finite or not positive are excluded.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.asarray(first, float) / np.asarray(1.0 if second is None else second, float)
        return mean_of(np.log(ratios), None, what).scaled(math.exp)


def gain_of(first: ArrayLike, second: ArrayLike | None = None, what: str = "") -> Quantity:
    """By how many per cent the scenes' values ``[S]`` are below others; without these the mean."""
    if second is None:
        return mean_of(first, None, what)
    return ratio_of(first, second, what).scaled(lambda ratio: 100 * (1 - ratio))


#: Estimates by the kind of a measure: of one variant's values, or of two on the same scenes.
KINDS: Mapping[str, Callable[..., Quantity]] = {
    "mean": mean_of,
    "percent": share_of,
    "ratio": ratio_of,
    "gain": gain_of,
}
