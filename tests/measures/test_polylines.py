"""Measures of contours against areas and distances that are known."""

import jax
import numpy as np
import pytest

from jaxpf.measures.polylines import REACH, measure_polylines


def circle(x, y, radius=40.0, count=64):
    angle = np.linspace(0, 2 * np.pi, count + 1)
    line = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
    line[-1] = line[0]
    return line


def segment(x, y, length=100.0, count=65):
    return np.stack([np.full(count, x), y + np.linspace(0, length, count)], axis=1)


@pytest.fixture(scope="module")
def measures():
    return jax.jit(measure_polylines)


def test_a_contour_fits_itself(measures):
    for line in (circle(50, 60), segment(20, 30)):
        found = measures(line, line)
        assert found["present"]
        assert found["tracked"]
        assert found["overlap"] == 1
        np.testing.assert_allclose(found["corner_error"], 0, atol=1e-4)


def test_two_circles_share_the_area_of_their_lens(measures):
    apart, radius = 30.0, 40.0
    half = np.arccos(apart / (2 * radius))
    lens = 2 * radius**2 * half - apart / 2 * np.sqrt(4 * radius**2 - apart**2)
    area = np.pi * radius**2
    found = measures(circle(50, 60), circle(50 + apart, 60))
    np.testing.assert_allclose(found["overlap"], lens / (2 * area - lens), atol=0.02)
    np.testing.assert_allclose(found["precision"], lens / area, atol=0.02)
    np.testing.assert_allclose(found["centre_error"], apart, atol=1e-3)


def test_an_open_contour_covers_what_lies_near_it(measures):
    shift = 4.0
    found = measures(segment(20, 30), segment(20 + shift, 30))
    share = (2 * REACH - shift) / (2 * REACH + shift)
    np.testing.assert_allclose(found["overlap"], share, atol=0.06)
    np.testing.assert_allclose(found["corner_error"], shift, atol=1e-3)
    # The way round does not matter, and neither does where the points lie.
    np.testing.assert_allclose(measures(segment(20, 30)[::-1], segment(20, 30))["overlap"], 1)


def test_what_is_absent_or_lost_counts_as_such(measures):
    line, nothing = circle(50, 60), np.full((65, 2), np.nan)
    found = measures(np.stack([line, nothing]), np.stack([nothing, line]))
    np.testing.assert_array_equal(found["present"], (False, True))
    np.testing.assert_array_equal(found["tracked"], (False, False))
    np.testing.assert_array_equal(found["overlap"], (np.nan, 0))
    assert np.isnan(found["corner_error"]).all()
