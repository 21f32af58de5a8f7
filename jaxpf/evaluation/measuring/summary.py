"""Summaries of all configurations of an evaluation: estimates and paired differences."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxpf.evaluation.measuring.collection import Summary
from jaxpf.evaluation.measuring.estimates import (
    Difference,
    Estimate,
    difference,
    estimate,
    holm,
    without_interval,
)
from jaxpf.evaluation.measuring.measures import FIGURES, MEASURES, SCORES, Measure
from jaxpf.evaluation.work.results import Results


class Runs(NamedTuple):
    """A measure over the runs of a configuration: ``runs [R]``, the other fields ``[R, P]``."""

    runs: np.ndarray
    values: np.ndarray
    weights: np.ndarray


def summarise(results: Results, summaries: Sequence[Summary]) -> None:
    """Add the estimates of all configurations, and their differences from their references."""
    for index, summary in enumerate(summaries):
        summary.reference = _reference(summaries[:index], summary)
    scored = any(len(summary.scores) for summary in summaries)
    speeds = dict(zip(map(repr, results.configurations), results.speeds, strict=True))
    compared = [summary for summary in summaries if summary.reference is not None]
    for measure in (*MEASURES, *(SCORES if scored else ())):
        values = [run_values(summary, measure) for summary in summaries]
        for summary, given in zip(summaries, values, strict=True):
            summary.estimates[measure.name] = _estimate(summary, measure, given)
            if summary.reference is not None:
                summary.differences[measure.name] = _difference(
                    summary, measure, given, values[summary.reference]
                )
        if compared:
            p = np.stack([summary.differences[measure.name].p for summary in compared])
            family = np.stack([holm(column) for column in p.T], axis=1)
            for summary, row in zip(compared, family, strict=True):
                found = summary.differences[measure.name]
                summary.differences[measure.name] = found._replace(p_holm=row)
    for summary in summaries:
        reliability, speed = summary.confidence, speeds[repr(summary.configuration)]
        figures = reliability.area(), reliability.silent(), speed
        for figure, value in zip(FIGURES, figures, strict=True):
            summary.estimates[figure.name] = _figure(value, summary.num_objects)


def _reference(earlier: Sequence[Summary], summary: Summary) -> int | None:
    """Index of a configuration's reference; None if no earlier one shares at least two seeds.

    The reference is the first configuration with the same parameters, so methods are compared at
    equal parameters.  If there is none, it is the first configuration of all.
    """
    ours = summary.configuration
    candidates = [
        index
        for index, other in enumerate(earlier)
        if not (ours.is_imported or other.configuration.is_imported)
        and len(np.intersect1d(other.numbers, summary.numbers)) > 1
    ]
    same = (i for i in candidates if earlier[i].configuration.parameters == ours.parameters)
    return next(itertools.chain(same, candidates), None)


def run_values(entry: Summary, measure: Measure) -> Runs:
    """Values of a measure for every run and object, with the weights for its mean."""
    if measure in SCORES:
        values = entry.scores[:, [SCORES.index(measure)]]
        return Runs(entry.numbers[: len(values)], values, np.ones_like(values))
    values = entry.column(measure.name)
    weights = entry.column(measure.weight) if measure.weight else np.ones_like(values)
    return Runs(entry.numbers, values, weights)


def common_runs(ours: Runs, theirs: Runs) -> tuple[Runs, Runs]:
    """Both at the runs that they share."""
    runs, left, right = np.intersect1d(ours.runs, theirs.runs, return_indices=True)
    return (
        Runs(runs, ours.values[left], ours.weights[left]),
        Runs(runs, theirs.values[right], theirs.weights[right]),
    )


def _estimate(entry: Summary, measure: Measure, given: Runs) -> Estimate:
    found = estimate(given.values, given.weights, measure.bounds)
    if measure in SCORES:
        found = Estimate(*_of_all_objects(found, entry.num_objects))
    return without_interval(found) if entry.configuration.is_imported else found


def _difference(entry: Summary, measure: Measure, given: Runs, other: Runs) -> Difference:
    ours, theirs = common_runs(given, other)
    found = difference(ours[1:], theirs[1:], measure.bounds)
    if measure in SCORES:
        found = Difference(*_of_all_objects(found, entry.num_objects))
    return found


def _figure(value: float, num_objects: int) -> Estimate:
    """A single figure of all objects, without an interval."""
    unknown = np.array([np.nan])
    is_finite = np.array([float(np.isfinite(value))])
    figure = (np.array([value]), unknown, unknown, unknown, is_finite)
    return Estimate(*_of_all_objects(figure, num_objects))


def _of_all_objects(found: Sequence[np.ndarray], num_objects: int) -> list[np.ndarray]:
    """Spread figures of all objects to ``[P + 1]``; single objects get NaN unless P is 1."""
    has = np.arange(num_objects + 1) == num_objects
    return [np.where(has | (num_objects == 1), figures[-1], np.nan) for figures in found]
