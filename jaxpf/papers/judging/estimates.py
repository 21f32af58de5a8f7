"""Figures with their intervals from what scenes gave: means, rates and differences.

The scenes are the units of all intervals: what happens on one is alike.
"""

import math
from typing import Any

import numpy as np

from jaxpf.measures.intervals import student_interval
from jaxpf.papers.judging.claims import Measured, Quantity, cluster_interval, newcombe, student
from jaxpf.papers.judging.comparison_table import Cell


def mean_of(values: Any, what: str = "", **claimed: Any) -> Quantity:
    """The mean of what the scenes gave, ``[S]``; NaN is left out.

    Args:
        values: one for each scene.
        what: for reports.
        claimed: ``at_least``, ``at_most``.
    """
    values = np.asarray(values, float)
    return Quantity(what, float(student_interval(values).value), student(values), **claimed)


def ratio_of(first: Any, second: Any, what: str = "", **claimed: Any) -> Quantity:
    """How many times one figure of the scenes, ``[S]``, is the other: the geometric mean.

    A mean of ratios is above one for either way to divide.  Scenes where one is not finite or not
    above 0 are left out.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithms = np.log(np.asarray(first, float) / np.asarray(second, float))
    found = mean_of(logarithms[np.isfinite(logarithms)])
    interval = found.interval

    def of_ratio(level: float) -> tuple[float, float]:
        low, high = interval(level)
        return math.exp(low), math.exp(high)

    return Quantity(what, math.exp(found.value), of_ratio, **claimed)


def rate_of(rates: Any, trials: int, what: str = "", **claimed: Any) -> Quantity:
    """A percentage from the scenes' rates ``[S]``, 0 to 1, of so many trials each, but for NaN."""
    rates = np.asarray(rates, float)
    rates = rates[np.isfinite(rates)]
    if not len(rates):
        return mean_of(rates, what, **claimed)
    return Quantity(what, 100 * float(rates.mean()), cluster_interval(rates, trials), **claimed)


def share_of(trials: Any, what: str = "", **claimed: Any) -> Quantity:
    """The percentage of trials ``[S, trials]`` bool that succeeded."""
    trials = np.asarray(trials)
    return rate_of(trials.mean(axis=1), trials.shape[1], what, **claimed)


def gap_of(first: Any, second: Any, what: str = "", **claimed: Any) -> Quantity:
    """The difference of two percentages of trials ``[S, trials]``, scene by scene, in points.

    Where all scenes differ alike nothing is seen of their variance: then each is one trial.
    """
    first, second = np.asarray(first, float), np.asarray(second, float)
    by_scene = 100 * (first.mean(axis=1) - second.mean(axis=1))
    if np.ptp(by_scene) > 0:
        return mean_of(by_scene, what, **claimed)
    number = len(by_scene)
    rates = float(first.mean()) * number, float(second.mean()) * number
    return Quantity(what, float(by_scene[0]), newcombe(rates, (number, number)), **claimed)


def mean_cell(values: Any, digits: int = 0, published: float | None = None) -> Cell:
    """The mean of what the scenes gave, ``[S]``, beside the published figure."""
    return Cell(published, mean_of(values).measured(), digits)


def rate_cell(rates: Any, trials: int, published: float | None = None) -> Cell:
    """A percentage from the scenes' rates ``[S]`` beside the published one."""
    return Cell(published, rate_of(rates, trials).measured())


def share_cell(trials: Any, published: float | None = None) -> Cell:
    """The percentage of trials ``[S, trials]`` bool beside the published one."""
    return Cell(published, share_of(trials).measured())


def only(value: float) -> Measured:
    """A figure without an interval."""
    return Measured(float(value), math.nan, math.nan)
