"""Measures of tracked boxes, as pure functions of arrays.

Boxes are (x, y, w, h) in pixels.  Estimates are typically ``[R, T, P, 4]`` (runs, frames,
objects) and the truth ``[T, P, 4]``; leading axes broadcast, so a single run needs no first axis.
Three rules hold throughout:

* A frame without truth (the true box is degenerate: not finite, or without width or height) does
  not count: its measures are NaN, and means leave it out.
* A degenerate *estimate* in a frame with truth is a miss: track state, precision, recall and
  IoU are 0, so reporting NaN gives no advantage.  Its centre error is NaN, and means leave it out.
* A mean without any values is NaN.

Source: smith2004, section 3.1, unless a function states another.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError, check_known
from jaxpf.lowering.programs import compiled
from jaxpf.measures.intervals import Interval, mean_interval, median_interval
from jaxpf.measures.means import masked_mean
from jaxpf.shapes.rectangles import area, centres, intersection_area, is_proper

Over = Literal["tracked", "all"]


# One frame


def has_truth(truth: ArrayLike) -> Array:
    """``[...]`` bool: whether each box of ``truth [..., 4]`` is finite and has an area."""
    return is_proper(truth)


def track_state(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """T: whether the estimated area E and the true area G share more than an edge.

    Args:
        estimate: ``[..., 4]`` boxes.
        truth: ``[..., 4]`` boxes.

    Returns:
        ``[...]`` bool; false where there is no truth.
    """
    return intersection_area(estimate, truth) > 0


def precision(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[...]``: share of the estimated area that is correct, area(E and G) / area(E)."""
    return _share_of_intersection(estimate, truth, area(estimate))


def recall(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[...]``: share of the true area that is covered, area(E and G) / area(G)."""
    return _share_of_intersection(estimate, truth, area(truth))


def iou(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[...]``: intersection over union, area(E and G) / area(E or G); not in smith2004."""
    union = area(estimate) + area(truth) - intersection_area(estimate, truth)
    return _share_of_intersection(estimate, truth, union)


def centre_error(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[...]``: distance between the boxes' centres in pixels; not in smith2004.

    NaN without truth, or if the estimate is not finite.
    """
    offset = centres(estimate) - centres(truth)
    return jnp.where(has_truth(truth), jnp.hypot(offset[..., 0], offset[..., 1]), jnp.nan)


# One run


def success(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """Whether an object was tracked throughout: T = 1 in every frame with truth.

    Args:
        estimate: ``[..., T, P, 4]`` boxes.
        truth: ``[..., T, P, 4]`` boxes.

    Returns:
        ``[..., P]`` bool; false for an object without truth.
    """
    return throughout(track_state(estimate, truth), _presence(estimate, truth))


def throughout(tracked: ArrayLike, present: ArrayLike) -> Array:
    """``success`` ``[..., P]`` from track state and presence, ``[..., T, P]`` bool each."""
    tracked, present = _of_frames(tracked, present)
    return jnp.all(tracked | ~present, axis=-2) & jnp.any(present, axis=-2)


def recovery(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """Whether an object was tracked at the end: T = 1 in its last frame with truth.

    The paper counts runs that "either successfully tracked throughout or recovered from lost
    tracking" without a duration; this is our interpretation.  Arguments and result as for
    ``success``.
    """
    return in_the_end(track_state(estimate, truth), _presence(estimate, truth))


def in_the_end(tracked: ArrayLike, present: ArrayLike) -> Array:
    """``recovery`` ``[..., P]`` from track state and presence, ``[..., T, P]`` bool each."""
    tracked, present = _of_frames(tracked, present)
    frames = jnp.arange(present.shape[-2])[:, None]
    last = jnp.max(jnp.where(present, frames, -1), axis=-2, keepdims=True, initial=-1)
    return jnp.any(tracked & (frames == last), axis=-2)


def mean_precision(
    estimate: ArrayLike,
    truth: ArrayLike,
    over: Over = "tracked",
    axis: int | Sequence[int] = -2,
) -> Array:
    """Mean precision over frames; by default only those with T = 1, as in smith2004.

    Args:
        estimate: ``[..., T, P, 4]`` boxes.
        truth: ``[..., T, P, 4]`` boxes.
        over: "tracked" averages over frames with T = 1, "all" over frames with truth.
        axis: axes of ``[..., T, P]`` to average over: -2 gives a mean per run, (-3, -2) pools the
            frames of all runs.

    Returns:
        ``[..., P]``; NaN where no frame counts.
    """
    counts = _frames_that_count(estimate, truth, over)
    return masked_mean(precision(estimate, truth), counts, axis)


def mean_recall(
    estimate: ArrayLike,
    truth: ArrayLike,
    over: Over = "tracked",
    axis: int | Sequence[int] = -2,
) -> Array:
    """Mean recall over frames; arguments and result as for ``mean_precision``."""
    counts = _frames_that_count(estimate, truth, over)
    return masked_mean(recall(estimate, truth), counts, axis)


# Many runs: intervals, in NumPy


def success_rate(estimate: ArrayLike, truth: ArrayLike, level: float = 0.95) -> Interval:
    """Share of runs with ``success``, with its interval over runs; see ``mean_interval``.

    Args:
        estimate: ``[R, T, P, 4]`` boxes.
        truth: ``[T, P, 4]`` boxes.
        level: confidence of the interval, in (0, 1).

    Returns:
        ``[P]`` each; NaN for an object without truth.
    """
    return _rate(success(estimate, truth), truth, level)


def recovery_rate(estimate: ArrayLike, truth: ArrayLike, level: float = 0.95) -> Interval:
    """Share of runs with ``recovery``; arguments and result as for ``success_rate``."""
    return _rate(recovery(estimate, truth), truth, level)


def summarise(
    boxes_estimate: ArrayLike, boxes_truth: ArrayLike, level: float = 0.95
) -> dict[str, Interval]:
    """All measures of many runs, for each object.

    Means pool the frames of all runs; their intervals treat runs, not frames, as independent.

    Args:
        boxes_estimate: ``[R, T, P, 4]``.
        boxes_truth: ``[T, P, 4]``.
        level: confidence of the intervals, in (0, 1).

    Returns:
        An ``Interval`` of ``[P]`` arrays for each of

        * ``success_rate``, ``recovery_rate``: shares of runs;
        * ``tracked``: share of frames with T = 1;
        * ``precision``, ``recall``: over frames with T = 1, as in smith2004's table 2;
        * ``precision_all``, ``recall_all``, ``iou``: over all frames with truth;
        * ``centre_error``: in pixels, the median over runs of each run's mean over frames with
          truth and a finite estimate, because errors have no bound.
    """
    estimate, truth = jnp.asarray(boxes_estimate), jnp.asarray(boxes_truth)
    if estimate.ndim != 4 or estimate.shape[1:] != truth.shape:  # they would broadcast
        raise InputError(
            f"boxes are {estimate.shape} and {truth.shape}; give [R, T, P, 4] and [T, P, 4]."
        )
    found = {
        name: median_interval(values, level=level)
        if name == "centre_error"
        else mean_interval(values, frames, level=level, bounds=(0.0, 1.0))
        for name, (values, frames) in _of_runs(estimate, truth).items()
    }
    rates = {each.__name__: each(estimate, truth, level) for each in (success_rate, recovery_rate)}
    return rates | found


# Compiled as a whole, because otherwise the first call compiles about a hundred small operations.
@compiled
def _of_runs(estimate: Array, truth: Array) -> dict[str, tuple[Array, Array]]:
    """Mean of each measure over the frames of each run that count, and their number, ``[R, P]``."""
    tracked, present = track_state(estimate, truth), _presence(estimate, truth)

    def over(values: Array, counts: Array) -> tuple[Array, Array]:
        counts = counts & jnp.isfinite(values)
        return masked_mean(values, counts, -2), jnp.sum(counts, axis=-2)

    precisions, recalls = precision(estimate, truth), recall(estimate, truth)
    return {
        "tracked": over(tracked.astype(precisions.dtype), present),
        "precision": over(precisions, tracked),
        "recall": over(recalls, tracked),
        "precision_all": over(precisions, present),
        "recall_all": over(recalls, present),
        "iou": over(iou(estimate, truth), present),
        "centre_error": over(centre_error(estimate, truth), present),
    }


# Helpers


def _of_frames(tracked: ArrayLike, present: ArrayLike) -> tuple[Array, Array]:
    return jnp.asarray(tracked, bool), jnp.asarray(present, bool)


def _share_of_intersection(estimate: ArrayLike, truth: ArrayLike, whole: Array) -> Array:
    """area(E and G) / whole: 0 for an empty whole, NaN without truth."""
    common = intersection_area(estimate, truth)
    share = jnp.where(whole > 0, common / jnp.where(whole > 0, whole, 1), 0)
    return jnp.where(has_truth(truth), share, jnp.nan)


def _presence(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``has_truth``, broadcast to the leading axes of the estimate."""
    shape = jnp.broadcast_shapes(jnp.shape(estimate), jnp.shape(truth))
    return jnp.broadcast_to(has_truth(truth), shape[:-1])


def _frames_that_count(estimate: ArrayLike, truth: ArrayLike, over: Over) -> Array:
    if over == "tracked":
        return track_state(estimate, truth)
    check_known("over=", over, get_args(Over))
    return _presence(estimate, truth)


def _rate(outcome: Array, truth: ArrayLike, level: float) -> Interval:
    """Rate of ``outcome [R, P]`` over runs; objects without truth have none."""
    ever = jnp.any(has_truth(truth), axis=-2)
    return mean_interval(outcome, ever, level=level, bounds=(0.0, 1.0))
