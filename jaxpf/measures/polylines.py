"""Measures of contours: distance from the true contour, precision and recall.

A contour is a polyline ``[..., V, 2]`` in pixels; in a closed contour the last point repeats the
first.  A point of one contour is matched if it lies within ``REACH`` pixels of the other;
precision and recall are those of Martin, Fowlkes and Malik (2004).
"""

import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

#: Largest distance, in pixels, at which a point of a contour is matched.
REACH = 5.0


def measure_polylines(estimate: ArrayLike, truth: ArrayLike) -> dict[str, Array]:
    """Compare contours with the true ones, frame by frame.

    Args:
        estimate: ``[..., V, 2]``, points at roughly equal spacing.
        truth: ``[..., V, 2]``, also at roughly equal spacing; the leading axes broadcast.

    Returns:
        ``[...]`` each: ``present`` (there is truth), ``tracked`` (a point is matched),
        ``precision`` and ``recall`` (shares p and r of matched points in the estimate and in the
        truth), ``iou`` (``p r / (p + r - p r)``, matched over all), ``centre_error`` (distance of
        the points' means, pixels), and ``corner_error`` (mean distance of one contour's points
        from the other contour, the larger of both directions, pixels).  Shares are 0 for an
        estimate that is not finite; without truth, all but the first two are NaN.
    """
    estimate, truth = jnp.broadcast_arrays(jnp.asarray(estimate), jnp.asarray(truth))
    present = jnp.all(jnp.isfinite(truth), axis=(-2, -1))
    has_both = jnp.all(jnp.isfinite(estimate), axis=(-2, -1)) & present
    ours, theirs = (jnp.where(has_both[..., None, None], x, 0.0) for x in (estimate, truth))
    to_truth, to_estimate = distances(ours, theirs), distances(theirs, ours)
    precision, recall = (
        jnp.where(has_both, jnp.mean(gaps <= REACH, axis=-1), 0.0)
        for gaps in (to_truth, to_estimate)
    )
    both = precision * recall
    either = precision + recall - both
    iou = jnp.where(either > 0, both / jnp.where(either > 0, either, 1.0), 0.0)
    centres = jnp.linalg.norm(jnp.mean(ours[..., 1:, :] - theirs[..., 1:, :], axis=-2), axis=-1)
    apart = jnp.maximum(jnp.mean(to_truth, axis=-1), jnp.mean(to_estimate, axis=-1))
    shares = {"precision": precision, "recall": recall, "iou": iou}
    shares = {name: jnp.where(present, value, jnp.nan) for name, value in shares.items()}
    shares |= {
        name: jnp.where(has_both, value, jnp.nan)
        for name, value in (("centre_error", centres), ("corner_error", apart))
    }
    return {"present": present, "tracked": precision > 0, **shares}


def distances(points: ArrayLike, line: ArrayLike) -> Array:
    """Distances ``[..., S]`` in pixels from points ``[..., S, 2]`` to polylines ``[..., V, 2]``."""
    points, line = jnp.asarray(points), jnp.asarray(line)

    def nearer(least, ends):
        start, end = (x[..., None, :] for x in ends)
        along, offset = end - start, points - start
        square = jnp.sum(along**2, axis=-1)
        place = jnp.sum(offset * along, axis=-1) / jnp.where(square > 0, square, 1.0)
        gap = offset - jnp.clip(place, 0, 1)[..., None] * along
        return jnp.minimum(least, jnp.sum(gap**2, axis=-1)), None

    sides = jnp.moveaxis(line, -2, 0)
    shape = jnp.broadcast_shapes(points.shape[:-1], (*line.shape[:-2], points.shape[-2]))
    begin = jnp.full(shape, jnp.inf, points.dtype)
    least, _ = lax.scan(nearer, begin, (sides[:-1], sides[1:]))
    return jnp.sqrt(least)
