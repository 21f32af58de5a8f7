"""Contours as splines of any order, closed and open."""

from jaxpf.models.splines import (
    CUBIC,
    basis,
    check_order,
    crosses_itself,
    even_places,
    fit_spline,
    points_on,
    resampled,
)

__all__ = [
    "CUBIC",
    "basis",
    "check_order",
    "crosses_itself",
    "even_places",
    "fit_spline",
    "points_on",
    "resampled",
]
