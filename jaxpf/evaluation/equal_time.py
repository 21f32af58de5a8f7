"""Compares methods at equal time: a slower method against a faster one with more particles.

This needs several numbers of particles and measured speeds (``--speed``).  The first method's
measures are interpolated linearly in the logarithm of time between two of its numbers of
particles, run by run, so that differences stay paired.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.evaluation.collection import Collected
from jaxpf.evaluation.measures import Measure
from jaxpf.evaluation.results import Configuration
from jaxpf.measures.estimates import Difference, mean_difference

if TYPE_CHECKING:
    from jaxpf.evaluation.summary import Summary

_PARTICLES = "particles"


class Runs(NamedTuple):
    """A measure over the runs of a configuration: ``runs [R]``, the other fields ``[R, P]``."""

    runs: np.ndarray
    values: np.ndarray
    weights: np.ndarray


class AtEqualTime(NamedTuple):
    """A configuration minus the first method at the same time per frame.

    Attributes:
        place: index of the configuration.
        references: indices of the first method's configurations with the next lower and higher
            times.
        seconds: per frame.
        differences: by measure, ``[P + 1]``.
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
    """Compare each configuration with the first method if its times bracket the configuration's.

    Args:
        collected: of every configuration.
        speeds: frames per second of each configuration; NaN if not measured.
        measures: to compare.
        runs_of: function that returns a measure of a configuration's runs.
    """
    if not collected:
        return []
    first = _kind(collected[0].configuration)[:2]
    comparisons = []
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
            comparisons.append(AtEqualTime(index, (one, other), seconds, differences))
    return comparisons


def curves(summaries: "Sequence[Summary]") -> "dict[str, list[Summary]]":
    """Group configurations that differ only in the number of particles; keyed by name.

    Each group is sorted by that number and has at least two entries.  Configurations without a
    measured speed are left out.
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
    """Seconds per frame from frames per second, in ascending order of particles.

    The running maximum removes timing noise: more particles cannot take less time.
    """
    return np.maximum.accumulate([1 / speed for speed in speeds] or [0.0])


def between(times: Sequence[float] | np.ndarray, seconds: float) -> tuple[int, float] | None:
    """Locate ``seconds`` between two consecutive entries of the ascending ``times``.

    Returns:
        Index of the lower entry and the relative position in log time, from 0 to 1; None if the
        times do not bracket ``seconds``.
    """
    for place, (low, high) in enumerate(itertools.pairwise(times)):
        if low <= seconds <= high and low < high:
            return place, float(np.log(seconds / low) / np.log(high / low))
    return None


def _number(summary: "Summary") -> Any:
    return summary.configuration.parameters[_PARTICLES]


def _kind(configuration: Configuration) -> tuple[str, str, tuple]:
    """Method, ordering, and all parameters except the number of particles."""
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
