"""Measures of convex outlines at any angle: area, IoU, and corner distances.

An outline is ``[..., V, 2]``: the V corners of a convex polygon in order, in pixels.  An outline
that is not finite or has no area has an empty intersection with any other.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jaxpf.measures.metrics import compared

#: Corners within this distance of an edge, relative to the outlines' extent, lie on it.
_ON_EDGE = 1e-6


def measure_outlines(estimate: ArrayLike, truth: ArrayLike) -> dict[str, Array]:
    """Compare outlines with the true ones, frame by frame.

    Args:
        estimate: ``[..., V, 2]``.
        truth: ``[..., V, 2]`` with corresponding corners; the leading axes broadcast.

    Returns:
        ``[...]`` each: ``present`` (there is truth), ``tracked`` (the areas intersect),
        ``precision`` and ``recall`` (intersection over the estimated and over the true area),
        ``iou`` (intersection over union), ``centre_error`` (distance of the centres, pixels)
        and ``corner_error`` (mean distance of corresponding corners, pixels).  Shares are 0 for an
        estimate without area; without truth, all but the first two are NaN.
    """
    estimate, truth = jnp.broadcast_arrays(jnp.asarray(estimate), jnp.asarray(truth))
    common = intersection_area(estimate, truth)
    ours, theirs = area(estimate), area(truth)
    present = theirs > 0
    offset = estimate - truth
    corners = jnp.mean(jnp.hypot(offset[..., 0], offset[..., 1]), axis=-1)
    return compared(common, ours, theirs, present, jnp.mean(offset, axis=-2)) | {
        "corner_error": jnp.where(present, corners, jnp.nan)
    }


def iou(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[...]``: intersection over union of outlines ``[..., V, 2]``; 0 if either is degenerate."""
    common = intersection_area(estimate, truth)
    union = area(estimate) + area(truth) - common
    return jnp.where(union > 0, common / jnp.where(union > 0, union, 1), 0)


def area(outline: ArrayLike) -> Array:
    """``[...]`` areas, square pixels; 0 for an outline that is not finite."""
    return jnp.abs(_signed_area(_centred(outline, outline)))


def intersection_area(one: ArrayLike, other: ArrayLike) -> Array:
    """Area of the intersection of two convex outlines, ``[...]``, by Green's theorem.

    Its boundary consists of the pieces of each outline's edges inside the other outline; a common
    edge counts once.  Differentiable almost everywhere.
    """
    first, second = jnp.broadcast_arrays(_centred(one, one), _centred(other, one))
    first, second = _clockwise(first), _clockwise(second)
    total = _inside(first, second, closed=True) + _inside(second, first, closed=False)
    proper = (_signed_area(first) > 0) & (_signed_area(second) > 0)
    smaller = jnp.minimum(_signed_area(first), _signed_area(second))
    return jnp.where(proper, jnp.clip(total, 0, smaller), 0)


def _inside(edges: Array, region: Array, *, closed: bool) -> Array:
    """Half the sum of cross products along the pieces of the edges inside the region."""
    start, end = edges[..., :, None, :], jnp.roll(edges, -1, axis=-2)[..., :, None, :]
    corner = region[..., None, :, :]
    along = jnp.roll(region, -1, axis=-2)[..., None, :, :] - corner
    # Distance from each of the region's edges times its length; positive is outside.
    before, after = -_cross(along, start - corner), -_cross(along, end - corner)
    tolerance = _ON_EDGE * jnp.max(jnp.sum(along**2, axis=-1), axis=-1, keepdims=True)
    on_edge = (jnp.abs(before) <= tolerance) & (jnp.abs(after) <= tolerance)
    slope = before - after
    crossing = before / jnp.where(slope == 0, 1.0, slope)
    enters = jnp.where((before > 0) & (after <= 0) & ~on_edge, crossing, 0.0)
    leaves = jnp.where((before <= 0) & (after > 0) & ~on_edge, crossing, 1.0)
    outside = (before > 0) & (after > 0) & ~on_edge
    same_way = jnp.sum((end - start) * along, axis=-1) > 0
    # Outlines with a common edge share area only if both lie on the same side of it.
    outside |= on_edge & ~(same_way & closed)
    first, last = jnp.max(enters, axis=-1), jnp.min(leaves, axis=-1)
    counts = (first < last) & ~jnp.any(outside, axis=-1)
    p, q = start[..., 0, :], end[..., 0, :]
    whole = _cross(p, q)  # a piece contributes in proportion to its length on the edge
    return 0.5 * jnp.sum(jnp.where(counts, (last - first) * whole, 0.0), axis=-1)


def _cross(one: Array, other: Array) -> Array:
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def _signed_area(outline: Array) -> Array:
    return 0.5 * jnp.sum(_cross(outline, jnp.roll(outline, -1, axis=-2)), axis=-1)


def _clockwise(outline: Array) -> Array:
    """Reorder the corners so that the signed area is positive."""
    return jnp.where(
        _signed_area(outline)[..., None, None] < 0, jnp.flip(outline, axis=-2), outline
    )


def _centred(outline: ArrayLike, around: ArrayLike) -> Array:
    """Shift an outline by another's centre, for precision; zeros if either is not finite."""
    outline, around = jnp.asarray(outline), jnp.asarray(around)
    dtype = jnp.result_type(outline.dtype, around.dtype, jnp.float32)
    finite = jnp.all(jnp.isfinite(outline), axis=(-2, -1), keepdims=True)
    is_finite = jnp.all(jnp.isfinite(around), axis=(-2, -1), keepdims=True)
    centre = jnp.mean(jnp.where(is_finite, around, 0.0), axis=-2, keepdims=True)
    return jnp.where(finite & is_finite, outline - centre, 0.0).astype(dtype)
