"""A line of the table of costs."""

from typing import NamedTuple

import numpy as np

from jaxpf.measures.timing import median_interval


class Row(NamedTuple):
    """One line of the table.

    Attributes:
        what: the thing measured.
        nanoseconds: median, per particle, partition and frame.
        ratio: median of the interleaved pairs' ratios, its sense told by ``of``.
        low: lower end of the ratio's 95 % interval (order statistics of the pairs).
        high: upper end.
        of: what the ratio compares.
        goal: what is asked of the ratio or the figure.
    """

    what: str
    nanoseconds: float
    ratio: float
    low: float
    high: float
    of: str
    goal: str


def compared(
    what: str, seconds: np.ndarray, units: float, baseline: np.ndarray, of: str, goal: str
) -> Row:
    """A row whose ratio is ``seconds`` over ``baseline`` (both ``[repeats]``)."""
    return _row(what, seconds / units, seconds / baseline, of, goal)


def ahead_of(
    what: str, seconds: np.ndarray, rival: np.ndarray, of: str = "OpenCV / this", goal: str = ""
) -> Row:
    """A row whose ratio is a rival's time over ``seconds``, both ``[repeats]`` and of one unit."""
    return _row(what, seconds, rival / seconds, of, goal)


def alone(what: str, seconds: np.ndarray) -> Row:
    """A row of what others are compared with: seconds of one unit, ``[repeats]``."""
    return Row(what, 1e9 * float(np.median(seconds)), 1, 1, 1, "", "")


def _row(what: str, seconds: np.ndarray, ratios: np.ndarray, of: str, goal: str) -> Row:
    return Row(what, 1e9 * float(np.median(seconds)), *median_interval(ratios), of, goal)
