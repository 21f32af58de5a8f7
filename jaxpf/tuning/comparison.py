"""Compare the tracker before and after tuning on held-out sequences."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from jaxpf.contract.errors import Argument, InputError
from jaxpf.measures import metrics
from jaxpf.measures.intervals import Interval, student_interval
from jaxpf.running.blocks import monte_carlo
from jaxpf.targets.target import Start, Target
from jaxpf.tuning.objectives import keep_estimate

#: Measure -> whether larger is better.  "success" and "recovery" as in smith2004; the others
#: average over all frames with ground truth, tracked or not.
MEASURES = {
    "overlap": True,
    "precision_all": True,
    "recall_all": True,
    "success": True,
    "recovery": True,
    "centre error": False,
    "corner error": False,
}


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """A held-out sequence for the comparison.

    Attributes:
        before: tracker with the values before tuning; starts just before the first frame.
        after: the same tracker with the tuned values.
        frames: ``[T, H, W, 3]``, or a lazy sequence, see ``jaxpf.monte_carlo``.
        truth: ``[T, P, S]`` ground-truth shapes, NaN where missing.
        target: kind of target.
        start: start of the objects, just before the first frame.
    """

    before: Any
    after: Any
    frames: Any
    truth: Any
    target: Target
    start: Start


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Means over units with Student's 95 % intervals, and paired differences.

    Attributes:
        unit: "sequences", or "runs" of a single sequence, whose intervals hold for it alone.
        count: number of units.
        before: measure -> mean; shares in 0 to 1, errors in pixels; NaN for a measure that the
            target does not define.
        after: the same with the tuned values.
        difference: after minus before, paired by unit and seed.
    """

    unit: str
    count: int
    before: dict[str, Interval]
    after: dict[str, Interval]
    difference: dict[str, Interval]

    def verdict(self, measure: str) -> str:
        """ "better", "worse", or "no clear difference" at the 95 % level."""
        change = self.difference[measure]
        sign = 1 if MEASURES[measure] else -1
        low, high = sorted((sign * float(change.lower), sign * float(change.upper)))
        if low > 0:
            return "better"
        return "worse" if high < 0 else "no clear difference"


def compare(sequences: Sequence[HeldOut], *, runs: int = 20, seed: int = 1) -> Comparison:
    """Run both trackers with the same seeds on every sequence.

    All measures are means over objects.  Precision, recall and overlap are also means over all
    frames with ground truth, counting 0 where an object is lost.

    Args:
        sequences: held-out sequences.
        runs: number of runs per sequence and tracker.
        seed: random seed of the runs; use a different one than for tuning.
    """
    if not sequences:
        raise InputError("there is no sequence to compare on; give at least one.")
    if len(sequences) == 1 and runs < 2:
        raise InputError(
            Argument("runs", runs), " on one sequence gives no interval; use at least 2."
        )
    columns: dict[str, list[np.ndarray]] = {"before": [], "after": []}
    for place, held_out in enumerate(sequences):
        keys = jax.random.split(jax.random.fold_in(jax.random.key(seed), place), runs)
        for name in columns:
            columns[name].append(_measured(getattr(held_out, name), keys, held_out))
    is_single = len(sequences) == 1
    before, after = (np.stack(x) for x in columns.values())
    # [sequences, runs, measures] -> [units, measures]
    before, after = (x[0] if is_single else x.mean(axis=1) for x in (before, after))

    def intervals(values: np.ndarray) -> dict[str, Interval]:
        return {name: student_interval(values[:, i]) for i, name in enumerate(MEASURES)}

    return Comparison(
        unit="runs" if is_single else "sequences",
        count=len(before),
        before=intervals(before),
        after=intervals(after),
        difference=intervals(after - before),
    )


def _measured(tracker: Any, keys: Any, held_out: HeldOut) -> np.ndarray:
    """``[R, measures]``, means over frames and objects."""
    estimates = np.asarray(monte_carlo(tracker, keys, held_out.frames, keep_estimate))
    truth = np.asarray(held_out.truth)
    shapes = held_out.target.shapes(held_out.start, estimates, tracker)
    measured = held_out.target.measures(held_out.start, shapes, truth)
    counts = np.broadcast_to(np.asarray(measured["present"]), shapes.shape[:-1])
    tracked, objects = np.asarray(measured["tracked"]), counts[0].any(axis=0)

    def mean(values: Any) -> np.ndarray:
        total = np.where(counts, np.nan_to_num(np.asarray(values)), 0).sum(axis=(1, 2))
        return total / counts[0].sum()

    def error(values: Any) -> np.ndarray:
        labelled = np.where(counts, np.asarray(values), np.nan)
        number = np.isfinite(labelled).sum(axis=(1, 2))
        return np.where(
            number > 0, np.nansum(labelled, axis=(1, 2)) / np.maximum(number, 1), np.nan
        )

    values = {
        "overlap": mean(measured["overlap"]),
        "precision_all": mean(measured["precision"]),
        "recall_all": mean(measured["recall"]),
        "success": np.asarray(metrics.throughout(tracked, counts))[:, objects].mean(axis=1),
        "recovery": np.asarray(metrics.in_the_end(tracked, counts))[:, objects].mean(axis=1),
        "centre error": error(measured["centre_error"]),
        "corner error": error(measured["corner_error"]),
    }
    return np.stack([values[name] for name in MEASURES], axis=-1)
