"""Boxes, and substates that have a centre and a scale.

A box is (x, y, w, h) in pixels, (x, y) its top left corner.  A substate begins with (u, v, a):
the centre in pixels and the scale relative to the object's reference size.  A box that is not
finite, or has no width or no height, is *degenerate*: its area is 0 and it intersects no other
box.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def boxes_from_substates(substates: ArrayLike, sizes: ArrayLike) -> Array:
    """The boxes of substates.

    Args:
        substates: ``[..., P, D]``, D >= 3, each beginning with (u, v, a); the rest is ignored.
        sizes: ``[P, 2]`` width and height of the objects at scale 1, in pixels.

    Returns:
        ``[..., P, 4]``: x = u - a w / 2, y = v - a h / 2, a w, a h.
    """
    substates, sizes = jnp.asarray(substates), jnp.asarray(sizes)
    extent = substates[..., 2:3] * sizes
    return jnp.concatenate([substates[..., :2] - extent / 2, extent], axis=-1)


def centres(boxes: ArrayLike) -> Array:
    """The centres ``[..., 2]`` of boxes ``[..., 4]``, in pixels; NaN for a box that is not finite.

    A box without area still has a centre.
    """
    boxes = jnp.asarray(boxes)
    is_finite = jnp.all(jnp.isfinite(boxes), axis=-1, keepdims=True)
    return jnp.where(is_finite, boxes[..., :2] + boxes[..., 2:] / 2, jnp.nan)


def corners_from_poses(poses: ArrayLike, sizes: ArrayLike) -> Array:
    """The corners of rectangles at any angle.

    Args:
        poses: ``[..., P, D]``, D >= 3, each beginning with (x, y, theta): the centre in pixels and
            the angle in radians, clockwise in the image; the rest is ignored.
        sizes: ``[P, 2]`` width and height in pixels.

    Returns:
        ``[..., P, 4, 2]``: the corners, at angle 0 top left, top right, bottom right, bottom left.
    """
    return _corners(jnp.asarray(poses), jnp.asarray(sizes))


@partial(jax.jit, inline=True)
def _corners(poses: Array, sizes: Array) -> Array:
    signs = jnp.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], sizes.dtype)
    offsets = jnp.moveaxis(signs * sizes[:, None] / 2, -1, 0)
    return poses[..., None, :2] + jnp.stack(rotate(offsets, poses[..., None, 2]), axis=-1)


def rotate(vector: ArrayLike, angle: ArrayLike) -> tuple[Array, Array]:
    """Rotate vectors ``[2, ...]`` clockwise by angles ``[...]``; return their x and y."""
    x, y = jnp.asarray(vector)
    cosine, sine = cos_sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y


def cos_sin(angle: ArrayLike) -> tuple[Array, Array]:
    """Cosine and sine of angles in radians; in float32 accurate to 2e-7 for angles up to 1e4.

    In float32 these are the polynomials of Moshier's Cephes library (``sinf.c``).  They compile
    to vector code; XLA's own functions are scalar calls, five times slower on a CPU.
    """
    angle = jnp.asarray(angle)
    if angle.dtype != jnp.float32:
        return jnp.cos(angle), jnp.sin(angle)
    quarter = jnp.floor(angle * (2 / jnp.pi) + 0.5)
    # pi / 2 in three parts; all but the last have few bits, so their products are exact.
    rest = ((angle - quarter * 1.5703125) - quarter * 4.8375129e-4) - quarter * 7.5497899e-8
    rest = jnp.clip(rest, -0.8, 0.8)  # an angle too large for float32 has no rest: stay bounded
    square = rest * rest
    sine = 8.3321608736e-3 - 1.9515295891e-4 * square
    sine = rest + rest * square * (-1.6666654611e-1 + square * sine)
    cosine = -1.388731625493765e-3 + 2.443315711809948e-5 * square
    cosine = 1 - 0.5 * square + square * square * (4.166664568298827e-2 + square * cosine)
    half_turns = jnp.floor(quarter / 2)
    is_odd = quarter - 2 * half_turns > 0.5
    sign = 1 - 2 * (half_turns - 2 * jnp.floor(half_turns / 2))
    return sign * jnp.where(is_odd, -sine, cosine), sign * jnp.where(is_odd, cosine, sine)


def is_proper(boxes: ArrayLike) -> Array:
    """``[...]`` bool: whether boxes ``[..., 4]`` are finite and have width and height."""
    boxes = jnp.asarray(boxes)
    return jnp.all(jnp.isfinite(boxes), axis=-1) & jnp.all(boxes[..., 2:] > 0, axis=-1)


def area(boxes: ArrayLike) -> Array:
    """Areas ``[...]`` of boxes ``[..., 4]``, in square pixels; 0 for a degenerate box."""
    extent = _proper_or_empty(boxes)[..., 2:]
    return extent[..., 0] * extent[..., 1]


def intersection_area(boxes: ArrayLike, other: ArrayLike) -> Array:
    """Intersection area of two boxes, in square pixels; 0 if either is degenerate.

    Boxes that only touch share nothing.  The result never exceeds either area, even with
    rounding.

    Args:
        boxes: ``[..., 4]``.
        other: ``[..., 4]``; the leading axes broadcast.

    Returns:
        ``[...]``.
    """
    first, second = _proper_or_empty(boxes), _proper_or_empty(other)
    start = jnp.maximum(first[..., :2], second[..., :2])
    end = jnp.minimum(first[..., :2] + first[..., 2:], second[..., :2] + second[..., 2:])
    # Rounding of x + w can widen a box, so limit each side to that of the narrower box.
    extent = jnp.minimum(end - start, jnp.minimum(first[..., 2:], second[..., 2:]))
    extent = jnp.maximum(extent, 0)
    return extent[..., 0] * extent[..., 1]


def _proper_or_empty(boxes: ArrayLike) -> Array:
    """The boxes as floats, with zeros in place of degenerate ones, so no NaN propagates."""
    proper, boxes = is_proper(boxes), jnp.asarray(boxes)
    boxes = boxes.astype(jnp.result_type(boxes.dtype, jnp.float32))
    return jnp.where(proper[..., None], boxes, 0)
