"""What the finished runs of an evaluation show: a table of estimates and one of differences."""

import dataclasses
import functools
import importlib.util
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from jaxpf import filters
from jaxpf.contract.numbers import plain
from jaxpf.evaluation.estimates import (
    LEVEL,
    Difference,
    Estimate,
    difference,
    estimate,
    holm,
    without_interval,
)
from jaxpf.evaluation.measures import (
    COLUMNS,
    FIGURES,
    FRAMES,
    MEASURES,
    SCORES,
    Measure,
    measure_batch,
)
from jaxpf.evaluation.results import BUILT_IN, Configuration, Results
from jaxpf.measures.calibration import Reliability
from jaxpf.measures.intervals import Interval, mean_interval
from jaxpf.measures.scores import tracking_scores

#: Quantiles of the centre error in the figure over time.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: Runs per configuration with standard scores, which take about 10 ms per 20 frames.
SCORED_RUNS = 100
#: Bins of probability integral transforms; the regions of 5, 10, ... % end on bin edges.
BINS = 40
#: Remark for scenes with a single object.
ONE_OBJECT = (
    "One object: there is nothing to order, so all orderings coincide (SIR, PS, DPS, SPS) and one "
    "is run unless methods are named."
)
#: Name of all objects together in the tables.
ALL = "all"


@dataclasses.dataclass(frozen=True)
class Summary:
    """Measures of the R finished runs of one configuration.

    Attributes:
        name: of the configuration, with the parameters that vary.
        configuration: that was run.
        speed: frames per second, NaN if not measured.
        numbers: ``[R]`` numbers of the finished runs.
        columns: ``[R, P, K]``, one for each of ``COLUMNS``.
        quantiles: of the centre error over runs and objects, ``[len(QUANTILES), T]``.
        success: curve at the K ``IOU_THRESHOLDS`` with its interval; fields ``[P + 1, K]``,
            all objects last.
        precision: curve at the K ``CENTRE_THRESHOLDS``.
        pit_values: counts of probability integral transforms in ``BINS`` equal bins, over x and
            y, all objects, and the frames in which they are tracked.
        confidence: its reliability, over all objects and frames with truth.
        scores: of the first ``SCORED_RUNS`` runs, ``[R, len(SCORES)]``; no rows if TrackEval is
            not installed.
    """

    name: str
    configuration: Configuration
    speed: float
    numbers: np.ndarray
    columns: np.ndarray
    quantiles: np.ndarray
    success: Interval
    precision: Interval
    pit_values: np.ndarray
    confidence: Reliability
    scores: np.ndarray

    @property
    def runs(self) -> int:
        """Number of finished runs, R."""
        return len(self.numbers)

    def of(self, measure: Measure) -> tuple[np.ndarray, np.ndarray]:
        """Values of a measure for every run and object, and the weights for its mean."""
        if measure in SCORES:
            values = self.scores[:, [SCORES.index(measure)]]
            return values, np.ones_like(values)
        values = self.columns[:, :, COLUMNS.index(measure.name)]
        if measure.weight:
            return values, self.columns[:, :, COLUMNS.index(measure.weight)]
        return values, np.ones_like(values)


def summaries_of(results: Results) -> list[Summary]:
    """Measure the finished runs of every configuration that has any.

    Batches are read one after another.  The columns stay in memory, some 300 bytes per run and
    object; while a configuration is measured, so do its curves and the errors of every frame,
    some 3000 bytes and 12 more per frame.

    Raises:
        InputError: a batch is damaged.
    """
    pairs = zip(results.configurations, results.speeds, strict=True)
    every = (_summary(results, configuration, speed) for configuration, speed in pairs)
    return [summary for summary in every if summary is not None]


def _summary(results: Results, configuration: Configuration, speed: float) -> Summary | None:
    truth, target = results.truth, results.target
    # The coordinates of a user-defined tracker are unknown.
    has_places = configuration.kind == BUILT_IN and target.has_places
    is_scored = target.has_boxes and has_scores()
    pieces: list[tuple[np.ndarray, ...]] = []
    scores: list[list[float]] = []
    pit_values, confidence = np.zeros(BINS, np.int64), Reliability()
    for batch in results.batches(configuration):
        piece = measure_batch(batch, truth, target, results.start, has_places)
        pit_values += np.histogram(piece.pit_values, BINS, (0, 1))[0]
        confidence.add(piece.confidence)
        error, curves = piece.centre_error, (piece.success, piece.precision)
        pieces.append((batch.runs, piece.columns, error, *curves))
        for boxes in batch.shapes[: SCORED_RUNS - len(scores)] if is_scored else ():
            values = tracking_scores(boxes, truth)
            scores.append([values[measure.name] for measure in SCORES])
    if not pieces:
        return None
    runs, columns, errors, success, precision = map(np.concatenate, zip(*pieces, strict=True))
    frames = columns[:, :, COLUMNS.index(FRAMES), None]
    return Summary(
        name=configuration_name(results, configuration),
        configuration=configuration,
        speed=speed,
        numbers=runs,
        columns=columns,
        quantiles=error_quantiles(errors),
        success=_curve(success, frames),
        precision=_curve(precision, frames),
        pit_values=pit_values,
        confidence=confidence,
        scores=np.array(scores).reshape(-1, len(SCORES)),
    )


def error_quantiles(errors: np.ndarray) -> np.ndarray:
    """``QUANTILES`` over runs and objects of errors ``[R, T, P]``, for every frame.

    NaN is ignored; a frame without an error has NaN.
    """
    by_frame = errors.swapaxes(0, 1).reshape(errors.shape[1], -1)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        return np.nanquantile(by_frame, QUANTILES, axis=1)


def _curve(curves: np.ndarray, frames: np.ndarray) -> Interval:
    """Mean of curves ``[R, P, K]`` over runs, with intervals; objects weigh by frames."""
    curves = curves.astype(np.float64)  # NaN for an object that never has truth
    total = np.maximum(np.sum(frames, axis=1, keepdims=True), 1)
    pooled = np.sum(frames * np.nan_to_num(curves), axis=1, keepdims=True) / total
    curves = np.concatenate([curves, pooled], axis=1)
    return mean_interval(curves, level=LEVEL, bounds=(0.0, 1.0))


def has_scores() -> bool:
    """Whether TrackEval, which computes the standard scores, is installed."""
    return importlib.util.find_spec("trackeval") is not None


def configuration_name(
    results: Results, configuration: Configuration, but: Sequence[str] = ()
) -> str:
    """Method, ordering, and the parameters that differ between configurations, except ``but``."""
    names = [name for name in results.varied if name not in but]
    return ", ".join([configuration.label, *named_values(configuration, names)])


def named_values(configuration: Configuration, names: Sequence[str]) -> list[str]:
    """Those of the named parameters that a configuration has, as "sharpness 20"."""
    values = configuration.parameters
    return [f"{name} {plain(values[name])}" for name in names if name in values]


def estimates_of(results: Results, summaries: Sequence[Summary]) -> pd.DataFrame:
    """A row per configuration, object ("all" for all objects) and measure that has a value.

    Columns: ``configuration``, the index of its summary, ``object``, ``measure``, ``runs``,
    ``value``, ``standard_error``, and the ends of the interval, ``lower`` and ``upper``.
    """
    measured = _measured(results, summaries)
    rows: list[tuple] = []
    for index, summary in enumerate(summaries):
        for measure, objects in measured:
            found = estimate(*summary.of(measure), measure.bounds)
            if summary.configuration.is_imported:
                found = without_interval(found)
            rows += [(index, name, measure.name, *x) for name, *x in _last(objects, *found)]
        reliability = summary.confidence
        figures = reliability.area(), reliability.silent(), summary.speed
        for measure, value in zip(FIGURES, figures, strict=True):
            rows += [
                (index, name, measure.name, 1, value, *3 * [np.nan]) for name in _whole(results)
            ]
        for place, numbers in enumerate(zip(reliability.runs, *reliability.shares(), strict=True)):
            if place < reliability.bins:
                rows.append((index, ALL, f"on_object_{place}", *numbers))
    table = pd.DataFrame(rows, columns=["configuration", "object", "measure", *Estimate._fields])
    return table[np.isfinite(table.value.astype(float))]


def differences_of(results: Results, summaries: Sequence[Summary]) -> pd.DataFrame:
    """Configurations minus their references on common seeds, a row as in ``estimates_of``.

    More columns: ``reference``, the index of its summary; ``gained`` and ``lost``, the number of
    runs in which the configuration or the reference has the larger value; ``p`` of no difference,
    and ``p_holm`` after Holm's correction over the configurations.
    """
    measured = _measured(results, summaries)
    rows: list[tuple] = []
    for index, summary in enumerate(summaries):
        reference = _reference(summaries[:index], summary)
        if reference is None:
            continue
        for measure, objects in measured:
            found = paired(summary, summaries[reference], measure)
            key = index, reference
            rows += [(*key, name, measure.name, *x) for name, *x in _last(objects, *found)]
    columns = ["configuration", "reference", "object", "measure", *Difference._fields]
    table = pd.DataFrame(rows, columns=columns)
    table["p_holm"] = table.groupby(["measure", "object"]).p.transform(holm)
    return table[np.isfinite(table.value.astype(float))]


def _measured(results: Results, summaries: Sequence[Summary]) -> list[tuple[Measure, list[str]]]:
    """Every measure, and the objects that have it: each and all, or of scores all together."""
    scores = SCORES if any(len(each.scores) for each in summaries) else ()
    names = [*map(str, results.object_ids), ALL]
    return [(m, names) for m in MEASURES] + [(m, _whole(results)) for m in scores]


def _whole(results: Results) -> list[str]:
    """All objects together; what exists of them alone is also that of a single one."""
    names = [*map(str, results.object_ids), ALL]
    return names if len(names) == 2 else [ALL]


def _last(names: Sequence[str], *fields: np.ndarray) -> Iterator[tuple]:
    """Each name with the entries of fields ``[P + 1]``, whose last ones are those of the names."""
    return zip(names, *(field[-len(names) :] for field in fields), strict=True)


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
    same = [i for i in candidates if earlier[i].configuration.parameters == ours.parameters]
    return next(iter([*same, *candidates]), None)


def paired(ours: Summary, theirs: Summary, measure: Measure, level: float = LEVEL) -> Difference:
    """The first minus the second over common runs; imported tracks are the same in every run."""
    both = [(each, each.of(measure)) for each in (ours, theirs)]
    own = [s.numbers[: len(x[0])] for s, x in both if not s.configuration.is_imported]
    runs = functools.reduce(np.intersect1d, own or [np.zeros(1)])

    def common(summary: Summary, found: tuple[np.ndarray, np.ndarray]) -> Any:
        rows: np.ndarray = np.isin(summary.numbers[: len(found[0])], runs)
        if summary.configuration.is_imported:
            rows = np.zeros(len(runs), int)
        return tuple(x[rows] for x in found)

    return difference(common(*both[0]), common(*both[1]), measure.bounds, level)


def intervals(
    table: pd.DataFrame, measure: str, of: str, configurations: Sequence[int]
) -> np.ndarray:
    """Value, lower and upper end ``[C, 3]`` of a measure and an object; NaN where there is none."""
    rows = table[(table.measure == measure) & (table.object == of)].set_index("configuration")
    return rows.reindex(configurations)[["value", "lower", "upper"]].to_numpy()


def remarks_of(results: Results, summaries: Sequence[Summary]) -> Iterator[str]:
    """Sentences about missing results and caveats."""
    finished = {summary.name: summary.runs for summary in summaries}
    configurations = results.configurations
    for configuration in configurations:
        name = configuration_name(results, configuration)
        runs = finished.get(name, 0)
        if configuration.is_imported:
            yield f"{name}: one track, the same for every seed; without intervals."
        elif runs < results.runs:
            yield f"{name}: {runs} of {results.runs} runs are finished."
    ours = [c for c in configurations if c.kind == BUILT_IN]
    ordered = any(filters.filter_of(c.method.lower()).by_default for c in ours)
    if len(results.object_ids) == 1 and ordered:
        yield ONE_OBJECT
    if not has_scores():
        yield "HOTA, MOTA and IDF1 are left out; pip install --no-deps trackeval adds them."
    elif any(summary.runs > SCORED_RUNS for summary in summaries):
        yield f"HOTA, MOTA and IDF1 are of the first {SCORED_RUNS} runs."


def reliability_of(summary: Summary) -> str:
    """Reliability of confidence of one configuration in a sentence."""
    confidence = summary.confidence
    value, bins = confidence.shares().value, confidence.bins
    shares = [
        f"{place / bins:.1f} to {(place + 1) / bins:.1f}: {100 * value[place]:.0f}%"
        for place in range(bins)
        if np.isfinite(value[place])
    ]
    area = confidence.area()
    area_text = f"; area under the curve {100 * area:.0f}%" if np.isfinite(area) else ""
    return (
        f"Confidence of {summary.name} (boxes on their object): {', '.join(shares)}{area_text}; "
        f"off its object, and not reported lost: {100 * confidence.silent():.0f}% of all frames."
    )
