"""Uniform B-splines, closed and open: outlines described by a few control points.

A contour is K control points in pixels.  A point on it is a weighted mean of ``degree + 1`` of
them, so everything here is one matrix from control points to points (Blake and Isard, Active
Contours, 1998, chapter 3).  An open spline begins at its first control point and ends at its last
(its outer knots are repeated).
"""

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole

CUBIC = 3
#: Largest degree of a spline.
_MOST_DEGREE = 20


def basis(
    places: ArrayLike, num_points: int, *, closed: bool, degree: int = CUBIC, derivative: int = 0
) -> np.ndarray:
    """The matrix ``[M, K]`` from control points to points at ``places``.

    Args:
        places: ``[M]``, position along the spline, 0 to 1; for a closed one, 1 is 0 again.
        num_points: K.
        closed: whether the spline is closed.
        degree: of its polynomials, 3 for cubic.
        derivative: 0 for points, 1 for their derivative with respect to the place.

    Raises:
        InputError: there are fewer than ``degree + 1`` control points.
    """
    from scipy.interpolate import BSpline  # slow to import (a third of a second)

    check_order(num_points, degree)
    places = np.atleast_1d(np.asarray(places, float))
    if closed:
        knots = np.arange(-degree, num_points + degree + 1, dtype=float)
        spans, at = num_points, (places % 1.0) * num_points
    else:
        spans = num_points - degree
        inner = np.arange(spans + 1, dtype=float)
        knots = np.concatenate([np.zeros(degree), inner, np.full(degree, float(spans))])
        at = places * spans
    at = np.clip(at, 0, np.nextafter(spans, 0))
    each = np.eye(len(knots) - degree - 1)
    values = spans**derivative * BSpline(knots, each, degree)(at, nu=derivative)
    if not closed:
        return values
    folded = np.zeros((len(at), num_points))
    for column in range(values.shape[1]):
        folded[:, column % num_points] += values[:, column]
    return folded


def even_places(count: int, *, closed: bool) -> np.ndarray:
    """``[count]`` evenly spaced places; those of an open spline include both ends."""
    return np.linspace(0.0, 1.0, count, endpoint=not closed)


def points_on(control: ArrayLike, count: int, *, closed: bool, degree: int = CUBIC) -> np.ndarray:
    """``count`` points ``[..., count, 2]`` along splines with control points ``[..., K, 2]``."""
    control = np.asarray(control, float)
    places = even_places(count, closed=closed)
    return basis(places, control.shape[-2], closed=closed, degree=degree) @ control


def fit_spline(points: ArrayLike, num_points: int, *, closed: bool) -> np.ndarray:
    """Control points ``[K, 2]`` of the least-squares cubic spline of a polyline.

    Args:
        points: ``[S, 2]``, the polyline in pixels, in order; a closed one without its first
            point repeated.
        num_points: K.
        closed: whether the polyline is closed.

    Raises:
        InputError: there are fewer than four control points, or the polyline is invalid.
    """
    check_order(num_points)
    even = resample_polyline(points, 8 * num_points, closed=closed)
    matrix = basis(even_places(len(even), closed=closed), num_points, closed=closed)
    return np.linalg.lstsq(matrix, even, rcond=None)[0]


def resample_polyline(points: ArrayLike, count: int, *, closed: bool) -> np.ndarray:
    """Place ``count`` points ``[count, 2]`` at equal distances along a polyline ``[S, 2]``.

    Raises:
        InputError: points are not finite, or all coincide.
    """
    points = np.asarray(points, float)
    if not np.isfinite(points).all():
        raise InputError("points of a polyline are not finite; give finite (x, y), [S, 2].")
    if closed:
        points = np.concatenate([points, points[:1]])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if len(points) < 2 or along[-1] <= 0:
        raise InputError("a polyline needs two different points at least.")
    at = even_places(count, closed=closed) * along[-1]
    return np.stack([np.interp(at, along, points[:, axis]) for axis in range(2)], axis=1)


def crosses_itself(points: ArrayLike, *, closed: bool) -> bool:
    """Whether two non-adjacent sides of a polyline ``[S, 2]`` intersect."""
    points = np.asarray(points, float)
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    starts = points[: len(ends)]
    sides = ends - starts
    between = starts[None] - starts[:, None]
    cross = sides[:, None, 0] * sides[None, :, 1] - sides[:, None, 1] * sides[None, :, 0]
    safe = np.where(cross == 0, 1.0, cross)
    here = (between[..., 0] * sides[None, :, 1] - between[..., 1] * sides[None, :, 0]) / safe
    there = (between[..., 0] * sides[:, None, 1] - between[..., 1] * sides[:, None, 0]) / safe
    meet = (cross != 0) & (here >= 0) & (here < 1) & (there >= 0) & (there < 1)
    apart = np.abs(np.subtract.outer(np.arange(len(sides)), np.arange(len(sides))))
    if closed:
        apart = np.minimum(apart, len(sides) - apart)
    return bool(np.any(meet & (apart > 1)))


def check_order(num_points: int, degree: int = CUBIC) -> None:
    """Reject fewer control points than the spline's order.

    Raises:
        InputError: there are fewer than ``degree + 1``.
    """
    check_whole("degree", degree, most=_MOST_DEGREE)
    if num_points < degree + 1:
        raise InputError(
            f"{num_points} control point(s) are fewer than the {degree + 1} that a spline of "
            f"degree {degree} needs; give {degree + 1} or more, or a lower degree."
        )
