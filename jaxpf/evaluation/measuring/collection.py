"""Measures the finished runs of one configuration: values per run, curves, quantiles and counts."""

import dataclasses
import importlib.util
import warnings
from collections.abc import Sequence

import numpy as np

from jaxpf.contract.options import plain
from jaxpf.evaluation.measuring.estimates import LEVEL, Difference, Estimate
from jaxpf.evaluation.measuring.measures import COLUMNS, FRAMES, SCORES, measure_batch
from jaxpf.evaluation.work.results import BUILT_IN, Configuration, Results
from jaxpf.measures.calibration import Reliability
from jaxpf.measures.intervals import Interval, mean_interval
from jaxpf.measures.scores import tracking_scores

#: Quantiles of the centre error in the figure over time.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: Runs per configuration with standard scores, which take about 10 ms per 20 frames.
SCORED_RUNS = 100
#: Bins of probability integral transforms; the regions of 5, 10, ... % end on bin edges.
BINS = 40


@dataclasses.dataclass
class Summary:
    """Measures of the R finished runs of one configuration, and what they show.

    ``collect`` makes it; ``jaxpf.evaluation.measuring.summary.summarise`` adds the last three.

    Attributes:
        name: of the configuration, with the parameters that vary.
        configuration: that was run.
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
        reference: index of the summary that this one is compared with, or None.
        estimates: by measure; ``[P + 1]``, all objects last.
        differences: from the reference, by measure.
    """

    name: str
    configuration: Configuration
    numbers: np.ndarray
    columns: np.ndarray
    quantiles: np.ndarray
    success: Interval
    precision: Interval
    pit_values: np.ndarray
    confidence: Reliability
    scores: np.ndarray
    reference: int | None = None
    estimates: dict[str, Estimate] = dataclasses.field(default_factory=dict)
    differences: dict[str, Difference] = dataclasses.field(default_factory=dict)

    @property
    def runs(self) -> int:
        """Number of finished runs, R."""
        return len(self.numbers)

    @property
    def num_objects(self) -> int:
        """Number of objects, P."""
        return self.columns.shape[1]

    def column(self, name: str) -> np.ndarray:
        """Values ``[R, P]`` of the column with a given name."""
        return self.columns[:, :, COLUMNS.index(name)]


def collect(results: Results, configuration: Configuration) -> Summary | None:
    """Measure the finished runs of one configuration; None if there are none.

    Batches are read one after another.  The columns stay in memory, some 300 bytes per run and
    object; while a configuration is collected, so do its curves and the errors of every frame,
    some 3000 bytes and 12 more per frame.
    """
    truth, target = results.truth, results.target
    # The coordinates of a user-defined tracker are unknown.
    has_places = configuration.kind == BUILT_IN and target.has_places
    is_scored = target.has_boxes and has_scores()
    runs: list[np.ndarray] = []
    pieces: list[tuple[np.ndarray, ...]] = []
    scores: list[list[float]] = []
    pit_values, confidence = np.zeros(BINS, np.int64), Reliability()
    for batch in results.batches(configuration):
        piece = measure_batch(batch, truth, target, results.start, has_places)
        pit_values += np.histogram(piece.pit_values, BINS, (0, 1))[0]
        confidence.add(piece.confidence)
        runs.append(batch.runs)
        pieces.append((piece.columns, piece.centre_error, piece.success, piece.precision))
        for boxes in batch.shapes[: SCORED_RUNS - len(scores)] if is_scored else ():
            values = tracking_scores(boxes, truth)
            scores.append([values[measure.name] for measure in SCORES])
    if not runs:
        return None
    columns, errors, success, precision = map(np.concatenate, zip(*pieces, strict=True))
    frames = columns[:, :, COLUMNS.index(FRAMES), None]
    return Summary(
        name=configuration_name(results, configuration),
        configuration=configuration,
        numbers=np.concatenate(runs),
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
