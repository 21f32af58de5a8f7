"""Crossings of contours with measurement lines, and their occlusion by opaque contours.

A contour is approximated by the polyline through the middles of its own lines.  Everything is one
scan along that polyline, for all lines and particles at once, so that no array of the size lines
times sides is ever needed.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_batching import custom_vmap

from jaxpf.likelihoods.contours.edges import Lines

_NEVER = 1e6


class Polyline(NamedTuple):
    """One polyline, or several in one list of points.

    Attributes:
        x: ``[V, ...]``, pixels.
        y: ``[V, ...]``.
        joined: ``[V]`` bool, whether a side joins the previous point to this one.
    """

    x: jax.Array
    y: jax.Array
    joined: np.ndarray


def outline(lines: Lines, offsets, closed: bool) -> Polyline:
    """The boundaries of a contour, from its measurement lines.

    Args:
        lines: ``[M, ...]``, in order along the contour.
        offsets: positions of the boundaries on the lines: ``[0.0]``, or both edges of a wire.
        closed: whether the last point is joined to the first.
    """
    xs, ys, joined = [], [], []
    for value in offsets:
        offset = jnp.asarray(value, lines.x.dtype)
        x, y = lines.x + offset * lines.along_x, lines.y + offset * lines.along_y
        if closed:
            x, y = jnp.concatenate([x, x[:1]]), jnp.concatenate([y, y[:1]])
        xs.append(x)
        ys.append(y)
        joined.append(np.arange(x.shape[0]) > 0)
    return Polyline(jnp.concatenate(xs), jnp.concatenate(ys), np.concatenate(joined))


def own_sides(num_lines: int, num_edges: int, closed: bool) -> np.ndarray:
    """``[V, M]`` bool: the sides that touch, and so cross, a line at its own boundary point."""
    order = np.arange(num_lines)
    point = np.tile(np.concatenate([order, order[:1]]) if closed else order, num_edges)
    before = np.roll(point, 1)
    return (point[:, None] == order) | (before[:, None] == order)


def sides_from(num_lines: int, num_edges: int, closed: bool) -> np.ndarray:
    """``[V, M]`` bool: the sides that end at a line or at a later one along the contour."""
    end = np.tile(np.arange(num_lines + closed), num_edges)
    return end[:, None] >= np.arange(num_lines)


def nearest_crossings(lines: Lines, polyline: Polyline, reach: float, keep: int, left_out=None):
    """Crossings of a polyline with lines, those nearest to the lines' middles.

    Args:
        lines: ``[M, ...]``.
        polyline: ``[V, ...]``, with the lines' axes after the first.
        reach: half the length of a line, pixels.
        keep: maximum number of crossings kept per line.
        left_out: ``[V, M]`` bool, sides to ignore for each line; or None.

    Returns:
        Places ``[keep, M, ...]`` in pixels from the lines' middles, and a bool mask of the
        crossings that exist.
    """
    shape, dtype = lines.x.shape, lines.x.dtype
    counts = jnp.asarray(polyline.joined)[:, None]
    if left_out is not None:
        counts = counts & ~jnp.asarray(left_out)
    counts = jnp.broadcast_to(counts, (counts.shape[0], shape[0]))
    counts = counts.reshape(*counts.shape, *[1] * (len(shape) - 1))

    def relative(x, y):
        """A point's signed distance from each line, and its position along it."""
        dx, dy = x[None] - lines.x, y[None] - lines.y
        return (
            dx * lines.along_y - dy * lines.along_x,
            dx * lines.along_x + dy * lines.along_y,
        )

    def step(carry, item):
        nearest, (far, place) = carry
        x, y, counts = item
        far_now, place_now = relative(x, y)
        passes = counts & ((far < 0) != (far_now < 0))
        rise = jnp.where(passes, far - far_now, 1.0)
        at = place + far / rise * (place_now - place)
        at = jnp.where(passes & (jnp.abs(at) <= reach), at, _NEVER)
        above = jnp.concatenate([jnp.zeros_like(nearest[:1]), nearest[:-1]])
        # Insertion into a list sorted by distance from the middle.
        inserted = jnp.where(jnp.abs(at) < jnp.abs(above), above, at)
        nearest = jnp.where(jnp.abs(at) < jnp.abs(nearest), inserted, nearest)
        return (nearest, (far_now, place_now)), None

    begin = jnp.full((keep, *shape), _NEVER, dtype), relative(polyline.x[0], polyline.y[0])
    (nearest, _), _ = lax.scan(step, begin, (polyline.x[1:], polyline.y[1:], counts[1:]))
    there = jnp.abs(nearest) <= reach
    return jnp.where(there, nearest, 0.0), there


@custom_vmap
def anywhere(there):
    """Whether anything is true in any run, bool ``[]``; under ``vmap`` a branch on it survives."""
    return jnp.any(there)


@anywhere.def_vmap
def _anywhere_in_all(size, batched, there):
    return anywhere(there), False


def first(places, there, keep: int):
    """The first ``keep`` existing places on each line.

    Args:
        places: ``[C, ...]``.
        there: bool, like ``places``, whether a place exists.
        keep: maximum number of places kept.

    Returns:
        Places ``[keep, ...]``, 0 if there are fewer, and a bool mask of those that exist.
    """
    if keep == places.shape[0]:
        return places, there
    number = jnp.cumsum(there, axis=0)
    chosen = [there & (number == k + 1) for k in range(keep)]
    kept = [jnp.sum(jnp.where(is_it, places, 0.0), axis=0) for is_it in chosen]
    return jnp.stack(kept), jnp.stack([jnp.any(is_it, axis=0) for is_it in chosen])


def is_inside(x, y, polyline: Polyline):
    """Whether points ``[..., N]`` lie inside a closed polyline ``[V, N]``, bool."""

    def step(carry, item):
        inside, (x_before, y_before) = carry
        x_now, y_now, counts = item
        spans = counts & ((y_before > y) != (y_now > y))
        rise = jnp.where(y_now != y_before, y_now - y_before, 1.0)
        left_of = x < x_before + (y - y_before) / rise * (x_now - x_before)
        return (inside ^ (spans & left_of), (x_now, y_now)), None

    shape = jnp.broadcast_shapes(x.shape, polyline.x[0].shape)
    begin = jnp.zeros(shape, bool), (polyline.x[0], polyline.y[0])
    items = polyline.x[1:], polyline.y[1:], jnp.asarray(polyline.joined[1:])
    (inside, _), _ = lax.scan(step, begin, items)
    return inside


def overlap(one: Polyline, other: Polyline):
    """Whether two closed polylines ``[V, N]`` have a corner inside each other, ``[N]`` bool."""
    return jnp.any(is_inside(one.x, one.y, other), axis=0) | jnp.any(
        is_inside(other.x, other.y, one), axis=0
    )
