"""Summaries of all configurations of an evaluation: estimates and paired differences."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxpf.contract.options import plain
from jaxpf.evaluation.measuring.collection import Collected
from jaxpf.evaluation.measuring.estimates import (
    Difference,
    Estimate,
    difference,
    estimate,
    holm,
    without_interval,
)
from jaxpf.evaluation.measuring.measures import FIGURES, MEASURES, SCORES, Measure
from jaxpf.evaluation.work.results import Configuration, Results


class Runs(NamedTuple):
    """A measure over the runs of a configuration: ``runs [R]``, the other fields ``[R, P]``."""

    runs: np.ndarray
    values: np.ndarray
    weights: np.ndarray


@dataclasses.dataclass(frozen=True)
class Summary:
    """Summary of the runs of one configuration.

    Attributes:
        collected: measures of its runs.
        name: of the configuration, with the parameters that vary.
        estimates: by measure; ``[P + 1]``, all objects last.
        reference: index of the summary that this one is compared with, or None.
        differences: from the reference, by measure.
        adjusted: Holm-adjusted p of each difference, ``[P + 1]``, by measure; the family is all
            comparisons of one measure and object.
    """

    collected: Collected
    name: str
    estimates: dict[str, Estimate]
    reference: int | None
    differences: dict[str, Difference]
    adjusted: dict[str, np.ndarray]

    @property
    def configuration(self) -> Configuration:
        """The configuration that was run."""
        return self.collected.configuration

    @property
    def runs(self) -> int:
        """Number of finished runs."""
        return len(self.collected.runs)


def summarise(results: Results, collected: Sequence[Collected]) -> list[Summary]:
    """Summarise the collected measures of each configuration, in the same order."""
    references = _references(collected)
    scored = any(len(entry.scores) for entry in collected)
    speeds = dict(zip(map(repr, results.configurations), results.speeds, strict=True))
    summaries = [
        Summary(
            collected=entry,
            name=configuration_name(results, entry.configuration),
            estimates={},
            reference=reference,
            differences={},
            adjusted={},
        )
        for entry, reference in zip(collected, references, strict=True)
    ]
    compared = [summary for summary in summaries if summary.reference is not None]
    for measure in (*MEASURES, *(SCORES if scored else ())):
        values = [run_values(entry, measure) for entry in collected]
        for summary, given in zip(summaries, values, strict=True):
            summary.estimates[measure.name] = _estimate(summary.collected, measure, given)
            if summary.reference is not None:
                summary.differences[measure.name] = _difference(
                    summary.collected, measure, given, values[summary.reference]
                )
        if compared:
            p = np.stack([summary.differences[measure.name].p for summary in compared])
            family = np.stack([holm(column) for column in p.T], axis=1)
            for summary, row in zip(compared, family, strict=True):
                summary.adjusted[measure.name] = row
    for summary in summaries:
        confidence, speed = summary.collected.confidence, speeds[repr(summary.configuration)]
        for figure, value in zip(FIGURES, (confidence.area(), speed), strict=True):
            summary.estimates[figure.name] = _figure(value, summary.collected.num_objects)
    return summaries


def configuration_name(
    results: Results, configuration: Configuration, but: Sequence[str] = ()
) -> str:
    """Name with the method, ordering, and the parameters that differ between configurations.

    Args:
        results: the evaluation.
        configuration: one of its configurations.
        but: parameters to leave out.
    """
    names = [name for name in results.varied if name not in but]
    return ", ".join([configuration.label, *named_values(configuration, names)])


def named_values(configuration: Configuration, names: Sequence[str]) -> list[str]:
    """Those of the named parameters that a configuration has, as "sharpness 20"."""
    values = configuration.parameters
    return [f"{name} {plain(values[name])}" for name in names if name in values]


def _references(collected: Sequence[Collected]) -> list[int | None]:
    """Index of each configuration's reference; None if no earlier one shares at least two seeds.

    The reference is the first configuration with the same parameters, so methods are compared at
    equal parameters.  If there is none, it is the first configuration of all.
    """
    references: list[int | None] = []
    for index, entry in enumerate(collected):
        candidates = [
            other
            for other in range(index)
            if not collected[other].configuration.is_imported
            and len(np.intersect1d(collected[other].runs, entry.runs)) > 1
        ]
        same = [
            other
            for other in candidates
            if collected[other].configuration.parameters == entry.configuration.parameters
        ]
        chosen = (same or candidates)[:1]
        references.append(chosen[0] if chosen and not entry.configuration.is_imported else None)
    return references


def run_values(entry: Collected, measure: Measure) -> Runs:
    """Values of a measure for every run and object, with the weights for its mean."""
    if measure in SCORES:
        values = entry.scores[:, [SCORES.index(measure)]]
        return Runs(entry.runs[: len(values)], values, np.ones_like(values))
    values = entry.column(measure.name)
    weights = entry.column(measure.weight) if measure.weight else np.ones_like(values)
    return Runs(entry.runs, values, weights)


def common_runs(ours: Runs, theirs: Runs) -> tuple[Runs, Runs]:
    """Both at the runs that they share."""
    runs, left, right = np.intersect1d(ours.runs, theirs.runs, return_indices=True)
    return (
        Runs(runs, ours.values[left], ours.weights[left]),
        Runs(runs, theirs.values[right], theirs.weights[right]),
    )


def _estimate(entry: Collected, measure: Measure, given: Runs) -> Estimate:
    found = estimate(given.values, given.weights, measure.bounds)
    if measure in SCORES:
        found = Estimate(*_of_all_objects(found, entry.num_objects))
    return without_interval(found) if entry.configuration.is_imported else found


def _difference(entry: Collected, measure: Measure, given: Runs, other: Runs) -> Difference:
    ours, theirs = common_runs(given, other)
    found = difference(ours[1:], theirs[1:], measure.bounds, measure.is_rate)
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
