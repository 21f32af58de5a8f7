"""Measures of contours: how far they lie from the true ones, and how much of the same they cover.

A contour is a polyline ``[..., V, 2]`` in pixels; a closed one's last point is its first.  A closed
contour covers what it encloses, an open one what lies within ``REACH`` pixels of it.  Areas are
counted on a grid over both contours, so that they are right to about a part in ``GRID``.
"""

import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

#: Pixels to either side of an open contour that count as its own.
REACH = 5.0
#: Cells of the grid along each side.
GRID = 64
#: Pairs that are compared at once, which bounds memory.
_AT_ONCE = 64


def measure_polylines(estimate: ArrayLike, truth: ArrayLike) -> dict[str, Array]:
    """How well contours fit the true ones, frame by frame.

    Args:
        estimate: ``[..., V, 2]``.
        truth: ``[..., V, 2]``, of the same kind, closed or open; the leading axes broadcast.

    Returns:
        What ``jaxpf.measures.outlines.measure_outlines`` returns.  ``corner_error`` is the mean
        distance of the estimate's points from the true contour, and of the true points from the
        estimate, whichever is larger: pixels, whatever the points' correspondence.
    """
    estimate, truth = jnp.broadcast_arrays(jnp.asarray(estimate), jnp.asarray(truth))
    shape = estimate.shape[:-2]
    pairs = tuple(x.reshape(-1, *x.shape[-2:]) for x in (estimate, truth))
    found = lax.map(lambda pair: _measures(*pair), pairs, batch_size=_AT_ONCE)
    return {name: value.reshape(shape) for name, value in found.items()}


def distances(points: Array, line: Array) -> Array:
    """Distances ``[S]`` of points ``[S, 2]`` from a polyline ``[V, 2]``, pixels."""

    def nearer(least, ends):
        start, end = ends
        along = end - start
        square = jnp.sum(along**2)
        place = (points - start) @ along / jnp.where(square > 0, square, 1.0)
        foot = start + jnp.clip(place, 0, 1)[:, None] * along
        return jnp.minimum(least, jnp.sum((points - foot) ** 2, axis=1)), None

    begin = jnp.full(points.shape[0], jnp.inf, points.dtype)
    least, _ = lax.scan(nearer, begin, (line[:-1], line[1:]))
    return jnp.sqrt(least)


def covered(points: Array, line: Array) -> Array:
    """Which of points ``[S, 2]`` a contour ``[V, 2]`` covers, bool ``[S]``."""

    def crosses(inside, ends):
        (x, y), (x_next, y_next) = ends
        spans = (y > points[:, 1]) != (y_next > points[:, 1])
        rise = jnp.where(y_next != y, y_next - y, 1.0)
        left = points[:, 0] < x + (points[:, 1] - y) / rise * (x_next - x)
        return inside ^ (spans & left), None

    inside, _ = lax.scan(crosses, jnp.zeros(points.shape[0], bool), (line[:-1], line[1:]))
    is_closed = jnp.all(line[0] == line[-1])
    return jnp.where(is_closed, inside, distances(points, line) <= REACH)


def _measures(estimate: Array, truth: Array) -> dict[str, Array]:
    """Of one pair ``[V, 2]``."""
    present = jnp.all(jnp.isfinite(truth))
    known = jnp.all(jnp.isfinite(estimate)) & present
    ours, theirs = jnp.where(known, estimate, 0.0), jnp.where(known, truth, 0.0)
    both = jnp.concatenate([ours, theirs])
    least, most = jnp.min(both, axis=0) - REACH, jnp.max(both, axis=0) + REACH
    middles = (jnp.arange(GRID) + 0.5) / GRID
    across, down = jnp.meshgrid(middles, middles)
    cells = least + (most - least) * jnp.stack([across.ravel(), down.ravel()], axis=1)
    one, other = covered(cells, ours), covered(cells, theirs)
    common = jnp.sum(one & other).astype(estimate.dtype)

    def share(of):
        whole = jnp.sum(of).astype(estimate.dtype)
        inside = jnp.where(known & (whole > 0), common / jnp.maximum(whole, 1), 0.0)
        return jnp.where(present, inside, jnp.nan)

    apart = jnp.maximum(jnp.mean(distances(ours, theirs)), jnp.mean(distances(theirs, ours)))
    centres = jnp.linalg.norm(jnp.mean(_once(ours) - _once(theirs), axis=0))
    return {
        "present": present,
        "tracked": known & (common > 0),
        "precision": share(one),
        "recall": share(other),
        "overlap": share(one | other),
        "centre_error": jnp.where(known, centres, jnp.nan),
        "corner_error": jnp.where(known, apart, jnp.nan),
    }


def _once(line: Array) -> Array:
    """A closed contour's first point counts once in its mean."""
    weight = jnp.ones(line.shape[0]).at[-1].set(jnp.where(jnp.all(line[0] == line[-1]), 0.0, 1.0))
    return line * (weight * line.shape[0] / jnp.sum(weight))[:, None]
