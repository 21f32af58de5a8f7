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

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.lowering.programs import compiled
from jaxpf.measures.intervals import Interval, mean_interval, median_interval
from jaxpf.shapes.rectangles import area, centres, intersection_area, is_proper


def measure_boxes(estimate: ArrayLike, truth: ArrayLike) -> dict[str, Array]:
    """Compare boxes with the true ones, frame by frame, with E the estimated and G the true area.

    Args:
        estimate: ``[..., 4]``.
        truth: ``[..., 4]``; the leading axes broadcast.

    Returns:
        ``[...]`` each: ``present`` (there is truth), ``tracked`` (T: E and G share more than an
        edge), ``precision`` (area(E and G) / area(E)), ``recall`` (area(E and G) / area(G)),
        and, not in smith2004, ``iou`` (area(E and G) / area(E or G)) and ``centre_error`` (distance
        of the centres, pixels).
    """
    estimate, truth = jnp.asarray(estimate), jnp.asarray(truth)
    common, ours, theirs = intersection_area(estimate, truth), area(estimate), area(truth)
    present = jnp.broadcast_to(is_proper(truth), common.shape)
    return compared(common, ours, theirs, present, centres(estimate) - centres(truth))


def compared(
    common: Array, ours: Array, theirs: Array, present: Array, offset: Array
) -> dict[str, Array]:
    """What ``measure_boxes`` returns, of areas and of the offset of the centres, ``[..., 2]``."""
    return {
        "present": present,
        "tracked": common > 0,
        "precision": share(common, ours, present),
        "recall": share(common, theirs, present),
        "iou": share(common, ours + theirs - common, present),
        "centre_error": jnp.where(present, jnp.hypot(offset[..., 0], offset[..., 1]), jnp.nan),
    }


def share(common: Array, whole: Array, present: Array) -> Array:
    """``common / whole``: 0 for an empty whole, NaN without truth."""
    ratio = jnp.where(whole > 0, common / jnp.where(whole > 0, whole, 1), 0)
    return jnp.where(present, ratio, jnp.nan)


def iou(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[...]``: intersection over union of boxes ``[..., 4]``, see ``measure_boxes``."""
    return measure_boxes(estimate, truth)["iou"]


def success(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """Whether an object was tracked throughout: T = 1 in every frame with truth.

    Args:
        estimate: ``[..., T, P, 4]`` boxes.
        truth: ``[..., T, P, 4]`` boxes.

    Returns:
        ``[..., P]`` bool; false for an object without truth.
    """
    found = measure_boxes(estimate, truth)
    return throughout(found["tracked"], found["present"])


def throughout(tracked: Array, present: Array) -> Array:
    """``success`` ``[..., P]`` from track state and presence, ``[..., T, P]`` bool each."""
    return jnp.all(tracked | ~present, axis=-2) & jnp.any(present, axis=-2)


def in_the_end(tracked: Array, present: Array) -> Array:
    """Whether an object was tracked at the end, "recovery": T = 1 in its last frame with truth.

    The paper counts runs that "either successfully tracked throughout or recovered from lost
    tracking" without a duration; this is our interpretation.  Arguments and result as for
    ``throughout``.
    """
    frames = jnp.arange(present.shape[-2])[:, None]
    last = jnp.max(jnp.where(present, frames, -1), axis=-2, keepdims=True, initial=-1)
    return jnp.any(tracked & (frames == last), axis=-2)


def masked_mean(values: ArrayLike, mask: ArrayLike, axis: int | Sequence[int]) -> Array:
    """Mean of the finite values where ``mask`` is true; NaN if there are none."""
    values = as_float(values)
    axis = axis if isinstance(axis, int) else tuple(axis)
    counts = jnp.isfinite(values) & jnp.asarray(mask, bool)
    total = jnp.sum(jnp.where(counts, values, 0), axis)
    number = jnp.sum(counts, axis)
    return jnp.where(number > 0, total / jnp.maximum(number, 1), jnp.nan)


def as_float(values: ArrayLike) -> Array:
    """Convert to a float array; integers and bools become the default float."""
    values = jnp.asarray(float(values) if isinstance(values, int) else values)
    return values.astype(jnp.result_type(values.dtype, jnp.float32))


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
    return {
        name: median_interval(values, level=level)
        if name == "centre_error"
        else mean_interval(values, frames, level=level, bounds=(0.0, 1.0))
        for name, (values, frames) in _of_runs(estimate, truth).items()
    }


# Compiled as a whole, because otherwise the first call compiles about a hundred small operations.
@compiled
def _of_runs(estimate: Array, truth: Array) -> dict[str, tuple[Array, Array]]:
    """Mean of each measure over the frames of each run that count, and their number, ``[R, P]``."""
    found = measure_boxes(estimate, truth)
    tracked, present = found["tracked"], found["present"]

    def over(counts: Array, name: str) -> tuple[Array, Array]:
        counts = counts & jnp.isfinite(found[name])
        return masked_mean(found[name], counts, -2), jnp.sum(counts, axis=-2)

    ever = jnp.any(present, axis=-2)
    return {
        "success_rate": (throughout(tracked, present), ever),
        "recovery_rate": (in_the_end(tracked, present), ever),
        "tracked": over(present, "tracked"),
        **{name: over(tracked, name) for name in ("precision", "recall")},
        **{f"{name}_all": over(present, name) for name in ("precision", "recall")},
        **{name: over(present, name) for name in ("iou", "centre_error")},
    }
