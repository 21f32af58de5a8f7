"""Measures of single runs; every table and figure is computed from them."""

import functools
import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from jaxpf.contract.logs import log_evidence
from jaxpf.evaluation.results import Batch
from jaxpf.lowering.programs import compiled
from jaxpf.measures import calibration, metrics
from jaxpf.measures.scores import CENTRE_THRESHOLDS, IOU_THRESHOLDS
from jaxpf.targets.target import Start, Target

#: Probabilities, in percent, of the regions whose coverage of the truth is measured.
REGIONS = (50, 80, 95)
#: The same for the size of boxes.
SIZE_REGIONS = (50, 95)
#: IoU at which a box counts as on its object, in the reliability of confidence.
ON_OBJECT = 0.1
#: Centre error threshold in pixels by which OTB ranks trackers (wu2013).
DISTANCE = 20
#: IoU above which a box counts as correct (wu2013).
HALF = 0.5
_RUNS_AT_ONCE = 256
_BOXES_AT_ONCE = 2**17


class Measure(NamedTuple):
    """One measure, which is one column of the table.

    Attributes:
        name: of the column.
        title: display name.
        weight: column that holds the weight of each run and object in means that pool frames; ""
            for equal weights.
        percent: displayed in percent.
        unit: of values that are not shares.
    """

    name: str
    title: str
    weight: str = ""
    percent: bool = False
    unit: str = ""

    @property
    def bounds(self) -> tuple[float, float] | None:
        """Smallest and largest possible value; None without, where tables show medians.

        False alarms lower MOTA without a bound.
        """
        return (0.0, 1.0) if self.percent and self.name != "MOTA" else None


#: Standard scores of a run over all objects; see ``jaxpf.measures.tracking_scores``.
SCORES = (
    Measure("HOTA", "HOTA", percent=True),
    Measure("MOTA", "MOTA", percent=True),
    Measure("MOTP", "MOTP", percent=True),
    Measure("IDF1", "IDF1", percent=True),
    Measure("IDSW", "identity switches"),
    Measure("Frag", "interruptions"),
)

#: OTB's curves (wu2013) and their thresholds: IoUs, and centre errors in pixels.
CURVES = {"success": IOU_THRESHOLDS, "precision": CENTRE_THRESHOLDS}
#: Columns that hold the number of frames in a mean.
FRAMES, TRACKED_FRAMES = "frames", "tracked_frames"

MEASURES = (
    Measure("success_rate_50", "success at IoU 0.5", weight=FRAMES, percent=True),
    Measure("success_auc", "success AUC", weight=FRAMES, percent=True),
    Measure("success", "smith2004 success", percent=True),
    Measure("recovered", "smith2004 recovery", percent=True),
    Measure("tracked_share", "tracked", weight=FRAMES, percent=True),
    Measure("precision", "precision", weight=TRACKED_FRAMES, percent=True),
    Measure("recall", "recall", weight=TRACKED_FRAMES, percent=True),
    Measure("precision_all", "precision, all frames", weight=FRAMES, percent=True),
    Measure("recall_all", "recall, all frames", weight=FRAMES, percent=True),
    Measure("iou", "IoU", weight=FRAMES, percent=True),
    Measure("distance_precision", "centre within 20 pixels", weight=FRAMES, percent=True),
    Measure("centre_error", "centre error", weight="located_frames", unit="pixels"),
    Measure("corner_error", "corner distance", weight="located_frames", unit="pixels"),
    Measure("distinct_share", "distinct particles", percent=True),
    *(
        Measure(f"coverage_{p}", f"truth in the {p}% region", weight=TRACKED_FRAMES, percent=True)
        for p in REGIONS
    ),
    *(
        Measure(
            f"size_coverage_{p}", f"size in the {p}% region", weight=TRACKED_FRAMES, percent=True
        )
        for p in SIZE_REGIONS
    ),
    Measure("crps", "CRPS", weight=TRACKED_FRAMES, unit="pixels"),
    Measure("log_score", "log score", weight=TRACKED_FRAMES),
    Measure("ess", "effective sample size"),
    Measure("log_evidence", "log evidence"),
    Measure("frames_without_likelihood", "frames without likelihood"),
)
#: Columns of counts; the table places them before the measures.
COUNTS = (FRAMES, TRACKED_FRAMES, "located_frames")
#: All columns of numbers, in the order of the table.
COLUMNS = (*COUNTS, *(measure.name for measure in MEASURES))


#: Single figures of a configuration, over all objects.
FIGURES = (
    Measure("confidence_area", "confidence, area", percent=True),
    Measure("silent", "off in silence", percent=True),
    Measure("frames_per_second", "frames/s"),
)


def by_name(name: str) -> Measure:
    """Return the measure with a given column name."""
    return next(measure for measure in (*MEASURES, *SCORES, *FIGURES) if measure.name == name)


class Measured(NamedTuple):
    """The measures of R runs and P objects over T frames.

    Attributes:
        columns: ``[R, P, K]``, one for each of ``COLUMNS``; NaN where a measure does not exist.
        centre_error: ``[R, T, P]`` in pixels, NaN where there is no truth or no estimate.
        success: ``[R, P, 21]``, see ``jaxpf.measures.scores.success_curve``.
        precision: ``[R, P, 51]``, the share of frames whose centre error is at most each of
            ``CENTRE_THRESHOLDS`` (wu2013).
        pit_values: ``[R, T, P, 2]`` of x and y, see ``jaxpf.measures.pit_values``; NaN where an
            object is not tracked or has no known position.
        confidence: ``[R, 2, 100]``, see ``jaxpf.measures.calibration.confidence_counts``.
    """

    columns: np.ndarray
    centre_error: np.ndarray
    success: np.ndarray
    precision: np.ndarray
    pit_values: np.ndarray
    confidence: np.ndarray


def measure_batch(
    batch: Batch,
    truth: np.ndarray,
    target: Target,
    start: Start,
    has_places: bool = False,
) -> Measured:
    """Measure every run of a batch.

    Args:
        batch: R runs.
        truth: ``[T, P, S]`` shapes, NaN where an object is absent.
        target: type of the objects.
        start: initial state of the objects.
        has_places: whether the first two spreads are those of the centre's x and y, in pixels,
            and of boxes the third that of the size relative to the start.
    """
    width = max(1, min(_RUNS_AT_ONCE, _BOXES_AT_ONCE // math.prod(truth.shape[:2])))
    measured = []
    for first in range(0, len(batch), width):
        runs = slice(first, first + width)
        piece = Batch(**{name: array[runs] for name, array in vars(batch).items()})
        frames = _measure_frames(piece.shapes, truth, width, target, start)
        measured.append(_measure_piece(piece, frames, has_places))
    return Measured(*map(np.concatenate, zip(*measured, strict=True)))


def _measure_piece(batch: Batch, frames: dict[str, np.ndarray], has_places: bool) -> Measured:
    present = frames["present"] > 0
    tracked, error = frames["tracked"] > 0, frames["centre_error"]
    # The last axis is OTB's thresholds; the mean is over frames.
    exceeds = frames["iou"][..., None] > IOU_THRESHOLDS.astype(np.float32)
    success = _mean(exceeds, present[..., None])
    # An object without an estimate has a NaN error, so it is within no threshold.
    within = error[..., None] <= CENTRE_THRESHOLDS.astype(np.float32)
    precision = _mean(within, present[..., None])
    offset = np.stack([frames["offset_x"], frames["offset_y"]], axis=-1)
    # Only frames in which the object is tracked: no region covers a lost object.
    asked = np.broadcast_to(has_places & tracked[..., None], offset.shape)
    model_error = batch.model_error[:, None]
    spread = np.where(asked, np.hypot(batch.spread[..., :2], model_error[..., :2]), np.nan)
    pit_values = calibration.pit_values(offset, spread)
    smallest = calibration.smallest_region(offset, spread)
    size_spread = np.full(tracked.shape, np.nan)
    if has_places and batch.spread.shape[-1] > 2:
        size = np.where(tracked, frames["size"], np.nan)
        size_spread = np.hypot(batch.spread[..., 2] / size, model_error[..., 2])  # of the logarithm
    size_smallest = calibration.smallest_region(frames["size_offset"], size_spread)
    on_object = np.where(present, frames["iou"] >= ON_OBJECT, np.nan)
    values = {
        FRAMES: np.sum(present, axis=1),
        TRACKED_FRAMES: np.sum(tracked, axis=1),
        "located_frames": np.sum(np.isfinite(error), axis=1),
        # Outcomes are repeated in every frame; they are NaN for an object without truth.
        "success": _mean(frames["success"], present),
        "recovered": _mean(frames["recovered"], present),
        "tracked_share": _mean(frames["tracked"], present),
        "precision": _mean(frames["precision"], tracked),
        "recall": _mean(frames["recall"], tracked),
        "precision_all": _mean(frames["precision"], present),
        "recall_all": _mean(frames["recall"], present),
        "iou": _mean(frames["iou"], present),
        "success_rate_50": _mean(frames["iou"] > HALF, present),
        "success_auc": np.mean(success, axis=-1),
        "distance_precision": precision[..., DISTANCE],
        "centre_error": _mean(error, present),
        "corner_error": _mean(frames["corner_error"], present),
        "distinct_share": _mean(batch.distinct_share),
        "crps": _mean_of_places(calibration.crps(offset, spread)),
        "log_score": _mean_of_places(calibration.log_score(offset, spread)),
        "ess": _mean(batch.ess)[:, None],
        "log_evidence": log_evidence(batch)[:, None],
        "frames_without_likelihood": np.sum(batch.without_likelihood, axis=1),
    }
    for percent in REGIONS:
        values[f"coverage_{percent}"] = _mean_of_places(_inside(smallest, percent))
    for percent in SIZE_REGIONS:
        values[f"size_coverage_{percent}"] = _mean(_inside(size_smallest, percent))
    shape = batch.shapes.shape[0], batch.shapes.shape[2]
    columns = np.stack([np.broadcast_to(values[name], shape) for name in COLUMNS], axis=-1)
    pit_values = pit_values.astype(np.float32)
    confidence = calibration.confidence_counts(batch.confidence, on_object)
    return Measured(columns.astype(np.float64), error, success, precision, pit_values, confidence)


def _inside(smallest: np.ndarray, percent: float) -> np.ndarray:
    """Whether a region holds the truth, given the smallest that does; NaN if that is unknown."""
    return np.where(np.isnan(smallest), np.nan, 100 * smallest <= percent)


def _mean(values: np.ndarray, counts: np.ndarray | bool = True) -> np.ndarray:
    """Mean over frames (axis 1) that count and have a finite value; NaN if there are none."""
    counts = np.isfinite(values) & counts
    total = np.sum(np.where(counts, values, 0), axis=1, dtype=np.float64)
    number = np.sum(counts, axis=1)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def _mean_of_places(values: np.ndarray) -> np.ndarray:
    """``_mean`` of the average of x and y, ``[R, T, P, 2]``."""
    return _mean(values.mean(axis=-1))


def _measure_frames(
    shapes: np.ndarray, truth: np.ndarray, width: int, target: Target, start: Start
) -> dict[str, np.ndarray]:
    """Measures of every frame, ``[R, T, P]`` each; outcomes of runs are repeated over frames.

    Runs are padded to ``width`` so that batches of all sizes share one compiled function.
    """
    padding = np.repeat(shapes[:1], width - len(shapes), axis=0)
    padded = np.concatenate([shapes, padding])
    frames = _compiled_measures(target, padded, truth, start.sizes)
    return {name: np.asarray(values)[: len(shapes)] for name, values in frames.items()}


@functools.partial(compiled, static_argnums=0)
def _compiled_measures(
    target: Target, shapes: Array, truth: Array, sizes: Array
) -> dict[str, Array]:
    shape = shapes.shape[:-1]
    measures = {"corner_error": jnp.full(shape, jnp.nan), **target.measures(shapes, truth, sizes)}
    offset = jnp.full((*shape, 2), jnp.nan)
    if target.has_places:
        middle = target.outlines(shapes, sizes).mean(axis=-2)
        offset = middle - target.outlines(truth, sizes).mean(axis=-2)
    measures |= {"offset_x": offset[..., 0], "offset_y": offset[..., 1]}
    measures |= {name: jnp.full(shape, jnp.nan) for name in ("size", "size_offset")}
    if target.has_boxes:  # a size is the square root of the area, relative to the start
        ours, theirs, first = (
            jnp.sqrt(box[..., -2] * box[..., -1]) for box in (shapes, truth, sizes)
        )
        measures |= {"size": ours / first, "size_offset": jnp.log(ours / theirs)}
    present = jnp.broadcast_to(measures["present"], shape)
    tracked = jnp.broadcast_to(measures["tracked"], shape)
    measures |= {
        "success": metrics.throughout(tracked, present)[:, None],
        "recovered": metrics.in_the_end(tracked, present)[:, None],
    }
    return {name: jnp.broadcast_to(x, shape).astype(shapes.dtype) for name, x in measures.items()}
