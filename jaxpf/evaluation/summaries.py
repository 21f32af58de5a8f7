"""What the finished runs of an evaluation show: tables of runs, estimates and differences."""

import dataclasses
import importlib.util
import warnings
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from jaxpf import filters
from jaxpf.evaluation.conclusion import areas_of, conclude
from jaxpf.evaluation.estimates import ALL, LEVEL, difference, estimate, holm, with_all
from jaxpf.evaluation.measures import (
    COLUMNS,
    CURVES,
    FIGURES,
    FRAMES,
    MEASURES,
    SCORES,
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
#: Columns of the tables of runs (with one per measure), curves, estimates and differences.
_RUN = ["configuration", "seed", "run", "object"]
_CURVE = ["configuration", "object", "curve", "threshold", "value", "lower", "upper"]
_COLUMN = ["measure", "object"]
_ESTIMATE = ["configuration", "object", "measure", "runs", *Interval._fields]
_DIFFERENCE = ["configuration", "reference", *_ESTIMATE[1:], "gained", "lost", "p"]


@dataclasses.dataclass(frozen=True)
class Summary:
    """What the finished runs of one configuration show besides tables.

    Attributes:
        runs: number of finished runs.
        quantiles: of the centre error over runs and objects, ``[len(QUANTILES), T]``.
        pit_values: counts of probability integral transforms in ``BINS`` equal bins, over x and
            y, all objects, and the frames in which they are tracked.
        confidence: its reliability, over all objects and frames with truth.
        scores: a row of ``SCORES`` for each of the first ``SCORED_RUNS`` runs; none if TrackEval
            is not installed.
    """

    runs: int
    quantiles: np.ndarray
    pit_values: np.ndarray
    confidence: Reliability
    scores: pd.DataFrame


@dataclasses.dataclass(frozen=True)
class Overview:
    """What the finished runs of an evaluation show.

    In the tables, ``configuration`` is the index of one of the evaluation's configurations, and
    the ``object`` of estimates is "all" for all together.

    Attributes:
        results: the evaluation.
        names: of all configurations, with the parameters that vary.
        summaries: of the configurations with finished runs, by index.
        runs: a row of ``COLUMNS`` per configuration, run and object.
        curves: a row per configuration, object, curve and threshold.
        estimates: a row per configuration, object and measure that has a value, see ``estimate``.
        differences: the same for configurations minus their ``reference``, see ``difference``.
            ``p_holm`` is after Holm's correction over the configurations.
        ranking: the configurations that have a success AUC, best first.
        conclusion: sentence on which configuration is best.
        remarks: sentences about missing results and caveats.
    """

    results: Results
    names: list[str]
    summaries: dict[int, Summary]
    runs: pd.DataFrame
    curves: pd.DataFrame
    estimates: pd.DataFrame
    differences: pd.DataFrame
    ranking: list[int]
    conclusion: str
    remarks: list[str]

    @property
    def ranked(self) -> list[int]:
        """The configurations with finished runs, the best first and those without a value last."""
        return [*self.ranking, *(index for index in self.summaries if index not in self.ranking)]


def measure_results(results: Results) -> Overview:
    """Measure the finished runs of an evaluation, finished or not.

    Batches are read one after another.  The tables stay in memory, some 600 bytes per run and
    object; while a configuration is measured, so do its curves and the errors of every frame,
    some 3000 bytes and 12 more per frame.

    Raises:
        InputError: a batch is damaged.
    """
    configurations, speeds = results.configurations, results.speeds
    names = [results.name_of(configuration) for configuration in configurations]
    measured = {index: each for index in range(len(names)) if (each := _measured(results, index))}
    summaries = {index: summary for index, (summary, _, _) in measured.items()}
    runs = _joined([runs for _, runs, _ in measured.values()], [*_RUN, *COLUMNS])
    curves = _joined([curves for _, _, curves in measured.values()], _CURVE)
    values, tables = {}, []
    for index, summary in summaries.items():
        rows = runs[runs.configuration == index]
        values[index], weights = _by_run(rows, summary.scores)
        found = estimate(values[index], weights)
        if configurations[index].is_imported:  # the same in every run
            found[["standard_error", "lower", "upper"]] = np.nan
        found = pd.concat([found, _figures(results, speeds[index], summary.confidence)])
        tables.append(found.reset_index().assign(configuration=index))
    estimates = _with_value(_joined(tables, _ESTIMATE))
    differences = _differences(configurations, values)
    areas = areas_of(estimates)
    ranking, conclusion = areas.index.tolist(), conclude(results, values, areas)
    remarks = [*_remarks(results, names, summaries)]
    made = Overview(
        results,
        names,
        summaries,
        runs,
        curves,
        estimates,
        differences,
        ranking,
        conclusion,
        remarks,
    )
    confident = [index for index in made.ranked if summaries[index].confidence.frames[-1]]
    remarks += [_reliability(names[index], summaries[index].confidence) for index in confident[:1]]
    return made


def _joined(tables: Sequence[pd.DataFrame], columns: list[str]) -> pd.DataFrame:
    if not tables:
        return pd.DataFrame(columns=columns)
    return pd.concat(tables, ignore_index=True)[columns]


def _with_value(table: pd.DataFrame) -> pd.DataFrame:
    return table[np.isfinite(table.value.astype(float))]


def _measured(results: Results, index: int) -> tuple[Summary, pd.DataFrame, pd.DataFrame] | None:
    """Summary, runs and curves of a configuration; None without a finished run."""
    truth, target, ids = results.truth, results.target, results.object_ids
    configuration = results.configurations[index]
    # The coordinates of a user-defined tracker are unknown.
    has_places = configuration.kind == BUILT_IN and target.has_places
    is_scored = target.has_boxes and has_scores()
    pieces: list[tuple[np.ndarray, ...]] = []
    scores: list[dict[str, float]] = []
    pit_values, confidence = np.zeros(BINS, np.int64), Reliability()
    for batch in results.batches(configuration):
        piece = measure_batch(batch, truth, target, results.start, has_places)
        pit_values += np.histogram(piece.pit_values, BINS, (0, 1))[0]
        confidence.add(piece.confidence)
        error, curves = piece.centre_error, (piece.success, piece.precision)
        pieces.append((batch.runs, piece.columns, error, *curves))
        for boxes in batch.shapes[: SCORED_RUNS - len(scores)] if is_scored else ():
            scores.append(tracking_scores(boxes, truth))
    if not pieces:
        return None
    runs, columns, errors, *every = map(np.concatenate, zip(*pieces, strict=True))
    head = index, results.seed, np.repeat(runs, len(ids)), np.tile(ids, len(runs))
    table = pd.DataFrame(columns.reshape(-1, len(COLUMNS)), columns=[*COLUMNS])
    table = table.assign(**dict(zip(_RUN, head, strict=True)))
    frames = columns[:, :, COLUMNS.index(FRAMES), None]
    drawn = [_curve(n, x, frames, ids) for n, x in zip(CURVES, every, strict=True)]
    of_runs = pd.DataFrame(scores, runs[: len(scores)], [each.name for each in SCORES], float)
    summary = Summary(len(runs), error_quantiles(errors), pit_values, confidence, of_runs)
    return summary, table, pd.concat(drawn).assign(configuration=index)


def error_quantiles(errors: np.ndarray) -> np.ndarray:
    """``QUANTILES`` over runs and objects of errors ``[R, T, P]``, for every frame.

    NaN is ignored; a frame without an error has NaN.
    """
    by_frame = errors.swapaxes(0, 1).reshape(errors.shape[1], -1)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        return np.nanquantile(by_frame, QUANTILES, axis=1)


def _curve(name: str, curves: np.ndarray, frames: np.ndarray, ids: Sequence[int]) -> pd.DataFrame:
    """Mean of curves ``[R, P, K]`` over runs, with intervals; objects weigh by frames."""
    curves = curves.astype(np.float64)  # NaN for an object that never has truth
    total = np.maximum(np.sum(frames, axis=1, keepdims=True), 1)
    pooled = np.sum(frames * np.nan_to_num(curves), axis=1, keepdims=True) / total
    curves = np.concatenate([curves, pooled], axis=1)
    found = mean_interval(curves, level=LEVEL, bounds=(0.0, 1.0))
    axes = [*map(str, ids), ALL], [name], [f"{threshold:g}" for threshold in CURVES[name]]
    points = pd.MultiIndex.from_product(axes, names=["object", "curve", "threshold"])
    ends = {end: getattr(found, end).ravel() for end in ("value", "lower", "upper")}
    return pd.DataFrame(ends, points).dropna(subset="value").reset_index()


def has_scores() -> bool:
    """Whether TrackEval, which computes the standard scores, is installed."""
    return importlib.util.find_spec("trackeval") is not None


def _by_run(rows: pd.DataFrame, scores: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Values and weights of a configuration: a row per run, a column per measure and object."""
    runs, names = rows.run.unique(), [each.name for each in MEASURES]
    objects = [*map(str, rows.object.unique()), ALL]
    weights = [rows[each.weight] if each.weight else np.ones(len(rows)) for each in MEASURES]
    shape = len(runs), len(objects) - 1, len(names)
    found = rows[names].to_numpy().reshape(shape), np.stack(weights, axis=-1).reshape(shape)
    columns = pd.MultiIndex.from_product([names, objects], names=_COLUMN)
    values, weighed = (
        pd.DataFrame(each.swapaxes(1, 2).reshape(len(runs), -1), runs, columns)
        for each in with_all(*found)
    )
    whole = _whole(objects[:-1])
    columns = pd.MultiIndex.from_product([scores.columns, whole], names=_COLUMN)
    of_all = pd.DataFrame(np.repeat(scores.to_numpy(), len(whole), axis=1), scores.index, columns)
    return values.join(of_all), weighed.join(of_all.notna().astype(float)).fillna(0.0)


def _whole(objects: Sequence[object]) -> list[str]:
    """Names of all objects together; what exists of them alone is also that of a single one."""
    return [*map(str, objects), ALL] if len(objects) == 1 else [ALL]


def _figures(results: Results, speed: float, confidence: Reliability) -> pd.DataFrame:
    """Estimates over all runs and objects together: reliability of confidence, and speed."""
    values = confidence.area(), confidence.silent(), speed
    rows = {
        (measure.name, name): (1, value, *3 * [np.nan])
        for measure, value in zip(FIGURES, values, strict=True)
        for name in _whole(results.object_ids)
    }
    by_bin = [*zip(confidence.runs, *confidence.shares(), strict=True)][: confidence.bins]
    rows |= {(f"on_object_{place}", ALL): found for place, found in enumerate(by_bin)}
    index = pd.MultiIndex.from_tuples(rows, names=_COLUMN)
    return pd.DataFrame([*rows.values()], index, _ESTIMATE[3:])


def _differences(
    configurations: Sequence[Configuration], values: Mapping[int, pd.DataFrame]
) -> pd.DataFrame:
    tables = []
    for index, ours in values.items():
        reference = _reference(configurations, values, index)
        if reference is not None:
            found = difference(ours, values[reference]).reset_index()
            tables.append(found.assign(configuration=index, reference=reference))
    table = _joined(tables, _DIFFERENCE)
    table["p_holm"] = table.groupby(_COLUMN).p.transform(holm)
    return _with_value(table)


def _reference(
    configurations: Sequence[Configuration], values: Mapping[int, pd.DataFrame], index: int
) -> int | None:
    """Index of a configuration's reference; None if no earlier one shares at least two seeds.

    The reference is the first configuration with the same parameters, so methods are compared at
    equal parameters.  If there is none, it is the first configuration of all.
    """
    ours = configurations[index]
    candidates = [
        other
        for other in values
        if other < index
        and not (ours.is_imported or configurations[other].is_imported)
        and len(values[other].index.intersection(values[index].index)) > 1
    ]
    same = [i for i in candidates if configurations[i].parameters == ours.parameters]
    return next(iter([*same, *candidates]), None)


def _remarks(
    results: Results, names: Sequence[str], summaries: Mapping[int, Summary]
) -> Iterator[str]:
    """Sentences about missing results and caveats."""
    finished = {index: summary.runs for index, summary in summaries.items()}
    for index, configuration in enumerate(results.configurations):
        runs = finished.get(index, 0)
        if configuration.is_imported:
            yield f"{names[index]}: one track, the same for every seed; without intervals."
        elif runs < results.runs:
            yield f"{names[index]}: {runs} of {results.runs} runs are finished."
    ours = [c for c in results.configurations if c.kind == BUILT_IN]
    ordered = any(filters.filter_of(c.method.lower()).by_default for c in ours)
    if len(results.object_ids) == 1 and ordered:
        yield ONE_OBJECT
    if not has_scores():
        yield "HOTA, MOTA and IDF1 are left out; pip install --no-deps trackeval adds them."
    elif any(runs > SCORED_RUNS for runs in finished.values()):
        yield f"HOTA, MOTA and IDF1 are of the first {SCORED_RUNS} runs."


def _reliability(name: str, confidence: Reliability) -> str:
    """Reliability of a configuration's confidence in a sentence."""
    value, bins = confidence.shares().value, confidence.bins
    shares = [
        f"{place / bins:.1f} to {(place + 1) / bins:.1f}: {100 * value[place]:.0f}%"
        for place in range(bins)
        if np.isfinite(value[place])
    ]
    area = confidence.area()
    area_text = f"; area under the curve {100 * area:.0f}%" if np.isfinite(area) else ""
    return (
        f"Confidence of {name} (boxes on their object): {', '.join(shares)}{area_text}; "
        f"off its object, and not reported lost: {100 * confidence.silent():.0f}% of all frames."
    )
