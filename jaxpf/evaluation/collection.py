"""Collects table rows and figure data in one pass over the runs of an evaluation.

Memory does not grow with the number of runs: batches are read one at a time, each measure goes to
a temporary file, and figure data are accumulated.
"""

import importlib.util
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from jaxpf.evaluation.measures import COLUMNS, SCORES, measure_batch
from jaxpf.evaluation.results import BUILT_IN, Configuration, Results
from jaxpf.evaluation.work.batches import Batch
from jaxpf.files.writing import report_os_errors
from jaxpf.measures.calibration import Reliability
from jaxpf.measures.estimates import LEVEL
from jaxpf.measures.scores import tracking_scores

#: Quantiles of the centre error in the figures over time.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: Runs per configuration with standard scores, which take about 10 ms per 20 frames.
SCORED_RUNS = 100
#: Bins of probability integral transforms; the regions of 5, 10, ... % end on bin edges.
BINS = 40
#: Number of frames per block when computing quantiles.
_BLOCK = 256


class Curve(NamedTuple):
    """Success or precision curves with intervals, ``[P + 1, K]`` each; all objects come last."""

    value: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class Collected(NamedTuple):
    """Measures collected from the runs of one configuration.

    Attributes:
        configuration: that was run.
        runs: ``[R]`` numbers of the finished runs.
        column: function from a column's name to its values ``[R, P]``.
        quantiles: of the centre error, ``[len(QUANTILES), T, P + 1]``; the last index pools all
            objects.
        success: curve at the K ``OVERLAP_THRESHOLDS``.
        precision: curve at the K ``CENTRE_THRESHOLDS``.
        transforms: counts of probability integral transforms in ``BINS`` equal bins, over x and
            y, all objects, and the frames in which they are tracked.
        confidence: its reliability, over all objects and frames with truth.
        scores: of the first ``SCORED_RUNS`` runs, ``[R, len(SCORES)]``; no rows if TrackEval is
            not installed.
    """

    configuration: Configuration
    runs: np.ndarray
    column: Callable[[str], np.ndarray]
    quantiles: np.ndarray
    success: Curve
    precision: Curve
    transforms: np.ndarray
    confidence: Reliability
    scores: np.ndarray

    @property
    def num_objects(self) -> int:
        """Number of objects, P."""
        return self.quantiles.shape[2] - 1


def collect(
    results: Results,
    configuration: Configuration,
    store: Path,
    on_batch: Callable[[Batch, np.ndarray], None] = lambda batch, columns: None,
) -> Collected | None:
    """Measure the finished runs of one configuration.

    Args:
        results: the evaluation.
        configuration: one of its configurations.
        store: an empty folder for temporary files; keep it while the result is in use.
        on_batch: called with every batch and its ``[R, P, K]`` columns.

    Returns:
        The measures, or None if no run is finished.
    """
    truth, scale = results.truth, results.noise_scale(configuration)
    # The coordinates of a user-defined tracker are unknown.
    has_places = configuration.kind == BUILT_IN and results.target.has_places
    runs: list[np.ndarray] = []
    confidence = Reliability()
    transforms = np.zeros(BINS, np.int64)
    errors = ErrorQuantiles(*truth.shape[:2])
    success, precision = _CurveMean(), _CurveMean()
    paths = [store / f"{index}.f4" for index in range(len(COLUMNS))]
    with report_os_errors("write", store), ExitStack() as stack:
        files = [stack.enter_context(open(path, "wb")) for path in paths]
        for batch in results.batches(configuration):
            measured = measure_batch(batch, truth, scale, results.target, results.start, has_places)
            transforms += np.histogram(measured.transforms, BINS, (0, 1))[0]
            for index, file in enumerate(files):
                file.write(measured.columns[:, :, index].astype(np.float32).tobytes())
            runs.append(batch.runs)
            confidence.add(measured.confidence)
            errors.add(measured.centre_error)
            frames = measured.columns[:, :, COLUMNS.index("frames"), None]
            success.add(measured.success, frames)
            precision.add(measured.precision, frames)
            on_batch(batch, measured.columns)
    if not runs:
        return None

    def column(name: str) -> np.ndarray:
        flat = np.fromfile(paths[COLUMNS.index(name)], np.float32)
        return flat.reshape(-1, truth.shape[1]).astype(np.float64)

    return Collected(
        configuration=configuration,
        runs=np.concatenate(runs),
        column=column,
        quantiles=errors.quantiles(QUANTILES),
        success=success.interval(),
        precision=precision.interval(),
        transforms=transforms,
        confidence=confidence,
        scores=_scores(results.batches(configuration), truth, results.target.has_boxes),
    )


class ErrorQuantiles:
    """Quantiles over runs of the error in every frame, from a histogram with bins of 2 %.

    A quantile is the middle of its bin, so it is accurate to 1 %.  Errors below 0.01 pixels or
    above about 10,000 count in the end bins.
    """

    _FIRST, _STEP, _BINS = 0.01, math.log(1.02), 700

    def __init__(self, num_frames: int, num_objects: int):
        self._shape = (num_frames, num_objects, self._BINS)
        self._counts = np.zeros(self._shape, np.int32)

    def add(self, errors: np.ndarray) -> None:
        """Add ``errors [R, T, P]`` to the histogram; NaN is ignored."""
        finite = np.isfinite(errors)
        logs = np.log(np.maximum(errors[finite], self._FIRST) / self._FIRST) / self._STEP
        bins = np.minimum(logs.astype(np.int64), self._BINS - 1)
        rows = np.arange(math.prod(self._shape[:2])).reshape(self._shape[:2])
        places = np.broadcast_to(rows, errors.shape)[finite] * self._BINS + bins
        np.add.at(self._counts.reshape(-1), places, 1)

    def quantiles(self, levels: Sequence[float]) -> np.ndarray:
        """Quantiles ``[len(levels), T, P + 1]``, all objects last; NaN for an empty histogram."""
        blocks = range(0, self._shape[0], _BLOCK)
        return np.concatenate([self._of_frames(first, levels) for first in blocks], axis=1)

    def _of_frames(self, first: int, levels: Sequence[float]) -> np.ndarray:
        counts = self._counts[first : first + _BLOCK]
        pooled = np.sum(counts, axis=1, keepdims=True)
        cumulative = np.cumsum(np.concatenate([counts, pooled], axis=1), axis=-1)
        total = cumulative[..., -1:]
        bins = [np.argmax(cumulative >= np.maximum(1, level * total), -1) for level in levels]
        middles = self._FIRST * np.exp((np.stack(bins) + 0.5) * self._STEP)
        return np.where(total[..., 0] > 0, middles, np.nan)


class _CurveMean:
    """Mean of curves over runs, from running sums of the first two moments."""

    def __init__(self) -> None:
        self._runs, self._sums = 0, np.zeros(())

    def add(self, curve: np.ndarray, frames: np.ndarray) -> None:
        curve = curve.astype(np.float64)  # NaN for an object that never has truth
        total = np.maximum(np.sum(frames, axis=1, keepdims=True), 1)
        pooled = np.sum(frames * np.nan_to_num(curve), axis=1, keepdims=True) / total
        curve = np.concatenate([curve, pooled], axis=1)
        self._runs += len(curve)
        self._sums = self._sums + np.sum([curve, curve**2], axis=1)

    def interval(self) -> Curve:
        value, square = self._sums / self._runs
        if self._runs == 1:
            return Curve(value, np.full_like(value, np.nan), np.full_like(value, np.nan))
        error = np.sqrt(np.maximum(square - value**2, 0) / (self._runs - 1))
        reach = NormalDist().inv_cdf((1 + LEVEL) / 2) * error
        return Curve(value, value - reach, value + reach)


def has_scores() -> bool:
    """Whether TrackEval, which computes the standard scores, is installed."""
    return importlib.util.find_spec("trackeval") is not None


def _scores(batches: Iterator[Batch], truth: np.ndarray, are_boxes: bool) -> np.ndarray:
    rows: list[list[float]] = []
    for batch in batches if are_boxes and has_scores() else ():
        for boxes in batch.shapes[: SCORED_RUNS - len(rows)]:
            scores = tracking_scores(boxes, truth)
            rows.append([scores[measure.name] for measure in SCORES])
        if len(rows) == SCORED_RUNS:
            break
    return np.array(rows).reshape(-1, len(SCORES))
