"""Splines: where they pass, that they fit what they are fitted to, what they refuse."""

import numpy as np
import pytest
from refusals import message_of

from jaxpf.shapes.splines import basis, crosses_itself, fit_spline, points_on, resample_polyline

PLACES = np.linspace(0.01, 0.99, 40)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_points_are_weighted_means_of_few_control_points(closed, degree):
    weights = basis(PLACES, 7, closed=closed, degree=degree)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert (weights >= 0).all()
    assert ((weights > 1e-12).sum(axis=1) <= degree + 1).all()


@pytest.mark.parametrize("closed", [True, False])
def test_the_derivative_is_that_of_the_points(closed):
    step = 1e-6
    change = basis(PLACES + step, 7, closed=closed) - basis(PLACES - step, 7, closed=closed)
    slope = basis(PLACES, 7, closed=closed, derivative=1)
    np.testing.assert_allclose(slope, change / (2 * step), atol=1e-7)


def test_an_open_spline_begins_and_ends_at_its_control_points():
    control = np.random.default_rng(0).normal(size=(6, 2))
    np.testing.assert_allclose(points_on(control, 9, closed=False)[[0, -1]], control[[0, -1]])


def test_a_closed_spline_has_no_ends():
    np.testing.assert_allclose(basis([0.0], 6, closed=True), basis([1.0], 6, closed=True))


def test_a_spline_is_fitted_to_a_circle_within_a_tenth_of_a_pixel():
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    circle = 100 + 50 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    fitted = points_on(fit_spline(circle, 10, closed=True), 77, closed=True)
    np.testing.assert_allclose(np.linalg.norm(fitted - 100, axis=1), 50, atol=0.1)


def test_resampled_points_lie_at_equal_distances():
    corner = resample_polyline([(0, 0), (10, 0), (10, 30)], 9, closed=False)
    np.testing.assert_allclose(np.linalg.norm(np.diff(corner, axis=0), axis=1), 5)


def test_a_line_that_crosses_itself_is_told_from_one_that_does_not():
    bow = np.array([(0, 0), (10, 10), (10, 0), (0, 10)])
    assert crosses_itself(bow, closed=True)
    assert crosses_itself(bow, closed=False)
    square = bow[[0, 2, 1, 3]]
    assert not crosses_itself(square, closed=True)


def test_too_few_control_points_are_refused():
    assert "3 control point" in message_of(basis, [0.5], 3, closed=True)
    assert "two different points" in message_of(fit_spline, [(1, 1)] * 2, 5, closed=False)
