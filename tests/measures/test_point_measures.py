"""Measures of points on small cases worked out by hand."""

import numpy as np

from jaxpf.measures import points

TRUTH = np.zeros((6, 2, 2))
TRUTH[3, 1] = np.nan
#: Two runs: distances 0..5 and all 1, for both points.
FOUND = np.stack([np.zeros((6, 2, 2)), np.zeros((6, 2, 2))])
FOUND[0, ..., 0] = np.arange(6)[:, None]
FOUND[1, ..., 1] = 1.0


def test_distances_leave_out_what_is_not_known():
    distance = points.point_distances(FOUND, TRUTH)
    assert np.isnan(distance[:, 3, 1]).all()
    np.testing.assert_array_equal(distance[0, :, 0], np.arange(6))
    np.testing.assert_array_equal(
        points.point_distances(FOUND, TRUTH, 2.0)[0, :, 0], np.arange(6) / 2
    )
    lengths = np.array([1, 2, 1, 1, 1, 5])
    assert points.point_distances(FOUND, TRUTH, lengths)[0, 5, 0] == 1


def test_means():
    distance = points.point_distances(FOUND, TRUTH)
    np.testing.assert_allclose(points.mean_error(distance), [27 / 11, 1])
    chosen = np.zeros((6, 2), bool)
    chosen[3] = True
    np.testing.assert_allclose(points.mean_error(distance, chosen), [3, 1])
    assert np.isnan(points.mean_error(distance, np.zeros((6, 2), bool))).all()


def test_recoveries_are_listed():
    visible = np.array([[1, 0], [0, 0], [0, 1], [1, 1], [1, 0], [0, 1]], bool)
    assert points.recoveries(visible) == [(0, 1, 3), (1, 4, 5)]


def test_points_are_kept_if_they_end_where_they_should():
    distance = points.point_distances(FOUND, TRUTH)
    np.testing.assert_array_equal(points.points_kept(distance, 2), [1, 2])
    nowhere = np.full((6, 2, 2), np.nan)
    np.testing.assert_array_equal(
        points.points_kept(points.point_distances(FOUND, nowhere), 9), [0, 0]
    )
