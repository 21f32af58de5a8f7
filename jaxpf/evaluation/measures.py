"""The measures of single runs, from which every table and figure is made."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jaxpf import metrics, scores
from jaxpf.evaluation.batches import Batch
from jaxpf.intervals import masked_mean

#: Coordinates by which the spread of a particle set is named.
COORDINATES = ("u", "v", "a")

_RUNS_AT_ONCE = 256
_BOXES_AT_ONCE = 2**19


class Measure(NamedTuple):
    """What a column of the table holds.

    Attributes:
        name: of the column.
        title: what people call it.
        is_rate: 0 or 1 in every run, so that its mean is a rate.
        weight: column with the weight of a run and object in means that pool frames; "" for
            equal weights.
        percent: shown in percent.
        unit: what it is counted in, if not a share.
    """

    name: str
    title: str
    is_rate: bool = False
    weight: str = ""
    percent: bool = False
    unit: str = ""


#: Standard scores of a run, over all objects: see ``jaxpf.scores.tracking_scores``.
SCORES = (
    Measure("HOTA", "HOTA", percent=True),
    Measure("MOTA", "MOTA", percent=True),
    Measure("MOTP", "MOTP", percent=True),
    Measure("IDF1", "IDF1", percent=True),
    Measure("IDSW", "identity switches"),
    Measure("Frag", "interruptions"),
)

#: Columns that say how many frames a mean is over.
FRAMES, TRACKED_FRAMES = "frames", "tracked_frames"

MEASURES = (
    Measure("success", "success", is_rate=True, percent=True),
    Measure("recovered", "recovery", is_rate=True, percent=True),
    Measure("tracked_share", "tracked", weight=FRAMES, percent=True),
    Measure("precision", "precision", weight=TRACKED_FRAMES, percent=True),
    Measure("recall", "recall", weight=TRACKED_FRAMES, percent=True),
    Measure("precision_all", "precision, all frames", weight=FRAMES, percent=True),
    Measure("recall_all", "recall, all frames", weight=FRAMES, percent=True),
    Measure("overlap", "overlap", weight=FRAMES, percent=True),
    Measure("success_area", "area under the success curve", weight=FRAMES, percent=True),
    Measure("distance_precision", "centre within 20 pixels", weight=FRAMES, percent=True),
    Measure("centre_error", "centre error", weight="located_frames", unit="pixels"),
    Measure("uniqueness", "uniqueness", percent=True),
    *(
        Measure(f"effective_dynamics_{name}", f"effective dynamics in {name}", percent=True)
        for name in COORDINATES
    ),
    *(
        Measure(f"effective_dynamics_var_{name}", f"effective dynamics in {name}, of variances")
        for name in COORDINATES
    ),
    Measure("ess", "effective sample size"),
    Measure("log_evidence", "log evidence"),
    Measure("frames_lost", "frames without likelihood"),
)
#: Columns of counts, which precede the measures in the table.
COUNTS = (FRAMES, TRACKED_FRAMES, "located_frames")
#: All columns of numbers, in the order of the table.
COLUMNS = (*COUNTS, *(measure.name for measure in MEASURES))


def by_name(name: str) -> Measure:
    """The measure of a column."""
    return next(measure for measure in (*MEASURES, *SCORES) if measure.name == name)


class Measured(NamedTuple):
    """The measures of R runs and P objects over T frames.

    Attributes:
        columns: ``[R, P, K]``, one for each of ``COLUMNS``; NaN where a measure does not exist.
        centre_error: ``[R, T, P]`` in pixels, NaN where there is no truth or no estimate.
        curve: ``[R, P, 21]``, see ``jaxpf.scores.success_curve``.
    """

    columns: np.ndarray
    centre_error: np.ndarray
    curve: np.ndarray


def measure_batch(batch: Batch, truth: np.ndarray, noise_scale: np.ndarray) -> Measured:
    """Measure every run of a batch.

    Batches of all sizes share one compiled function: they are cut into pieces and padded.

    Args:
        batch: R runs.
        truth: ``[T, P, 4]`` boxes, NaN where an object is absent.
        noise_scale: ``[D]``, standard deviation of the process noise.
    """
    num_frames, num_objects = truth.shape[:2]
    width = _width(num_frames * num_objects)
    noise_scale, spread = _three_coordinates(noise_scale, batch.spread)
    arrays = (
        *(batch.boxes, batch.uniqueness, spread),
        *(batch.ess, batch.log_evidence, batch.lost),
    )
    parts = []
    for start in range(0, len(batch), width):
        pieces = [array[start : start + width] for array in arrays]
        size = len(pieces[0])
        padded = [np.concatenate([x, np.repeat(x[:1], width - size, axis=0)]) for x in pieces]
        measured = _measure(truth, noise_scale, *padded)
        parts.append([np.asarray(x)[:size] for x in measured])
    columns, error, curve = (np.concatenate(part) for part in zip(*parts, strict=True))
    columns = columns.astype(np.float64)
    # A long sum of large terms: single precision would show in differences.
    evidence = np.sum(batch.log_evidence.astype(np.float64), axis=1, keepdims=True)
    columns[:, :, COLUMNS.index("log_evidence")] = evidence
    return Measured(columns, error, curve)


def _width(boxes_per_run: int) -> int:
    """Runs that are measured at once: fewer where a run is long, so that memory stays small."""
    return max(1, min(_RUNS_AT_ONCE, 2 ** int(np.log2(max(1, _BOXES_AT_ONCE // boxes_per_run)))))


def _three_coordinates(scale: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first three coordinates, with NaN in place of those that a tracker does not have."""
    count = len(COORDINATES)
    missing = max(0, count - spread.shape[-1])
    spread = np.pad(spread[..., :count], [(0, 0)] * 3 + [(0, missing)], constant_values=np.nan)
    scale = np.asarray(scale, np.float64)[:count]
    return np.pad(scale, (0, count - len(scale)), constant_values=np.nan), spread


@jax.jit
def _measure(
    truth: Array,
    noise_scale: Array,
    boxes: Array,
    uniqueness: Array,
    spread: Array,
    ess: Array,
    log_evidence: Array,
    lost: Array,
) -> tuple[Array, Array, Array]:
    present = jnp.broadcast_to(metrics.has_truth(truth), boxes.shape[:-1])
    tracked = metrics.track_state(boxes, truth)
    precision, recall = metrics.precision(boxes, truth), metrics.recall(boxes, truth)
    overlap, error = metrics.overlap(boxes, truth), metrics.centre_error(boxes, truth)
    ever = jnp.any(present, axis=-2)

    def mean(values: Array, counts: Array = present) -> Array:
        return masked_mean(values, counts, -2)

    def if_ever(outcome: Array) -> Array:
        return jnp.where(ever, outcome.astype(overlap.dtype), jnp.nan)

    curve = scores.success_curve(boxes, truth)
    dynamics = metrics.effective_dynamics(spread, noise_scale)
    everywhere = jnp.ones(uniqueness.shape, bool)

    def over_time(values: Array) -> list[Array]:
        means = masked_mean(values, everywhere[..., None], -3)
        return [means[..., index] for index in range(len(COORDINATES))]

    def of_run(values: Array) -> Array:
        return jnp.broadcast_to(values[:, None], ever.shape)

    values = {
        FRAMES: jnp.sum(present, axis=-2),
        TRACKED_FRAMES: jnp.sum(tracked, axis=-2),
        "located_frames": jnp.sum(jnp.isfinite(error), axis=-2),
        "success": if_ever(metrics.success(boxes, truth)),
        "recovered": if_ever(metrics.recovery(boxes, truth)),
        "tracked_share": mean(tracked.astype(overlap.dtype)),
        "precision": mean(precision, tracked),
        "recall": mean(recall, tracked),
        "precision_all": mean(precision),
        "recall_all": mean(recall),
        "overlap": mean(overlap),
        "success_area": jnp.mean(curve, axis=-1),
        "distance_precision": scores.distance_precision(boxes, truth),
        "centre_error": mean(error),
        "uniqueness": mean(uniqueness, everywhere),
        "ess": of_run(jnp.mean(ess, axis=-1)),
        "log_evidence": of_run(jnp.sum(log_evidence, axis=-1)),
        "frames_lost": jnp.sum(lost, axis=-2),
    }
    for prefix, ratio in (
        ("effective_dynamics_", dynamics.deviation_ratio),
        ("effective_dynamics_var_", dynamics.variance_ratio),
    ):
        for name, column in zip(COORDINATES, over_time(ratio), strict=True):
            values[prefix + name] = column
    columns = jnp.stack([values[name].astype(overlap.dtype) for name in COLUMNS], axis=-1)
    return columns, error, curve
