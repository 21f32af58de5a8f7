"""Measures of contours against distances and shares that are known."""

import jax
import numpy as np
import pytest

from jaxpf.measures.polylines import REACH, measure_polylines


def circle(x, y, radius=40.0, count=64):
    angle = np.linspace(0, 2 * np.pi, count + 1)
    line = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
    line[-1] = line[0]
    return line


def upright(x, first=0.0, last=100.0):
    return np.stack([np.full(65, float(x)), np.linspace(first, last, 65)], axis=1)


@pytest.fixture(scope="module")
def measures():
    return jax.jit(measure_polylines)


def test_a_contour_fits_itself_whichever_way_round(measures):
    lines = np.stack([circle(50, 60), upright(20)])
    for found in (measures(lines, lines), measures(lines[:, ::-1], lines)):
        assert found["tracked"].all()
        np.testing.assert_array_equal(found["iou"], 1)
        np.testing.assert_allclose(found["corner_error"], 0, atol=1e-4)


def test_a_contour_that_lies_beside_the_true_one_is_as_far_off(measures):
    lines = np.stack([circle(50, 60, 40), upright(20)])
    found = measures(lines, np.stack([circle(50, 60, 43), upright(23)]))
    np.testing.assert_array_equal(found["iou"], 1)
    np.testing.assert_allclose(found["corner_error"], 3, atol=0.06)
    np.testing.assert_allclose(found["centre_error"], (0, 3), atol=1e-3)
    far = measures(lines, np.stack([circle(50, 60, 50), upright(27)]))
    np.testing.assert_array_equal(far["iou"], 0)
    assert not far["tracked"].any()


def test_half_a_contour_is_half_of_it(measures):
    found = measures(upright(20, 0, 100), upright(20, 0, 50))
    share = (50 + REACH) / 100
    np.testing.assert_allclose(found["precision"], share, atol=0.02)
    np.testing.assert_array_equal(found["recall"], 1)
    np.testing.assert_allclose(found["iou"], share, atol=0.02)


def test_what_is_absent_or_lost_counts_as_such(measures):
    line, nothing = circle(50, 60), np.full((65, 2), np.nan)
    found = measures(np.stack([line, nothing]), np.stack([nothing, line]))
    np.testing.assert_array_equal(found["present"], (False, True))
    np.testing.assert_array_equal(found["tracked"], (False, False))
    np.testing.assert_array_equal(found["iou"], (np.nan, 0))
    assert np.isnan(found["corner_error"]).all()
