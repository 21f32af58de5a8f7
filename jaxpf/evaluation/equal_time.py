"""Methods compared at equal time: what a slower one gains is set against more particles.

Where several numbers of particles were asked for and speeds were measured (``--speed``), the first
method's figures at a time that lies between two of its numbers are read off a straight line over
the logarithm of time, run by run, so that differences stay paired.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.evaluation.collection import Collected
from jaxpf.evaluation.estimates import Difference, mean_difference
from jaxpf.evaluation.measures import Measure
from jaxpf.evaluation.results import Configuration

if TYPE_CHECKING:
    from jaxpf.evaluation.summary import Summary

_PARTICLES = "particles"


class Runs(NamedTuple):
    """A measure of the runs of a configuration: ``runs [R]``, the others ``[R, P]``."""

    runs: np.ndarray
    values: np.ndarray
    weights: np.ndarray


class AtEqualTime(NamedTuple):
    """A configuration less the first method given the same time.

    Attributes:
        place: of the configuration.
        references: of the two of the first method whose times are next below and above.
        seconds: that a frame takes.
        differences: for each measure, ``[P + 1]``.
    """

    place: int
    references: tuple[int, int]
    seconds: float
    differences: dict[str, Difference]


def at_equal_time(
    collected: Sequence[Collected],
    speeds: Sequence[float],
    measures: Sequence[Measure],
    runs_of: Callable[[Collected, Measure], Runs],
) -> list[AtEqualTime]:
    """Compare with the first method wherever its times reach to both sides.

    Args:
        collected: of every configuration.
        speeds: frames per second of each; NaN where nobody measured it.
        measures: which.
        runs_of: a measure of a configuration's runs.
    """
    if not collected:
        return []
    first = _kind(collected[0].configuration)[:2]
    found = []
    for index, entry in enumerate(collected):
        kind = _kind(entry.configuration)
        if kind[:2] == first or not np.isfinite(speeds[index]):
            continue
        others = sorted(
            (one.configuration.parameters[_PARTICLES], other)
            for other, one in enumerate(collected)
            if _kind(one.configuration) == (*first, kind[2]) and np.isfinite(speeds[other])
        )
        places = [other for _, other in others]
        times = times_of([speeds[other] for other in places])
        seconds = 1 / speeds[index]
        if (among := between(times, seconds)) is not None:
            low, share = among
            one, other = places[low], places[low + 1]
            differences = {}
            for measure in measures:
                ours, less, more = (
                    runs_of(collected[each], measure) for each in (index, one, other)
                )
                differences[measure.name] = _difference(ours, less, more, share)
            found.append(AtEqualTime(index, (one, other), seconds, differences))
    return found


def curves(summaries: "Sequence[Summary]") -> "dict[str, list[Summary]]":
    """Configurations that differ in their number of particles alone, in its order, by their name.

    Only those whose speed was measured, and of two numbers or more.
    """
    lines: dict[Any, list[Summary]] = {}
    for summary in summaries:
        if _PARTICLES in summary.configuration.parameters and np.isfinite(
            summary.frames_per_second
        ):
            lines.setdefault(_kind(summary.configuration), []).append(summary)
    ordered = [sorted(line, key=_number) for line in lines.values() if len(line) > 1]
    return {line[0].name.replace(f", particles {_number(line[0])}", ""): line for line in ordered}


def times_of(speeds: Sequence[float]) -> np.ndarray:
    """Seconds of a frame from frames per second, by the number of particles.

    More particles take no less: what says so is how the times were measured.
    """
    return np.maximum.accumulate([1 / speed for speed in speeds] or [0.0])


def between(times: Sequence[float] | np.ndarray, seconds: float) -> tuple[int, float] | None:
    """Between which two of rising times another lies.

    Returns:
        The place of the one below, and how far it is from there to the next, by the logarithm of
        time; None where the times do not reach to both sides.
    """
    for place, (low, high) in enumerate(itertools.pairwise(times)):
        if low <= seconds <= high and low < high:
            return place, float(np.log(seconds / low) / np.log(high / low))
    return None


def _number(summary: "Summary") -> Any:
    return summary.configuration.parameters[_PARTICLES]


def _kind(configuration: Configuration) -> tuple[str, str, tuple]:
    """Method, ordering, and all parameters but the number of particles."""
    others = {n: v for n, v in configuration.parameters.items() if n != _PARTICLES}
    return configuration.method, configuration.ordering, tuple(sorted(others.items(), key=str))


def _difference(ours: Runs, low: Runs, high: Runs, share: float) -> Difference:
    common = np.intersect1d(ours.runs, np.intersect1d(low.runs, high.runs))
    ours, low, high = (_chosen(each, common) for each in (ours, low, high))
    between = (1 - share) * low.values + share * high.values
    weights = (1 - share) * low.weights + share * high.weights
    return mean_difference(ours.values, ours.weights, between, weights)


def _chosen(given: Runs, runs: np.ndarray) -> Runs:
    rows = np.isin(given.runs, runs)
    return Runs(*(each[rows] for each in given))
