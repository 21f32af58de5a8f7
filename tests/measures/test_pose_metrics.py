"""Measures of articulated objects, against figures worked out by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.measures.particle_sets import corner_distances, pose_variance, resamplings_per_frame
from jaxpf.ordering import named
from jaxpf.shapes.rectangles import corners_from_poses

SIZES = np.array([[6.0, 8.0], [2.0, 2.0]])  # half diagonals 5 and sqrt(2)
TREE = (-1, 0, 0, 1, 2, 3, 4)


def corners(*poses):
    return corners_from_poses(np.array(poses, float), SIZES)


TRUTH = corners([10, 10, 0], [20, 10, 0])


def test_corner_distances_by_hand():
    assert corner_distances(TRUTH, TRUTH) == 0
    # One part is 3 right and 4 down: four corners, 5 pixels each.
    moved = corners([13, 14, 0], [20, 10, 0])
    np.testing.assert_allclose(corner_distances(moved, TRUTH), 20, rtol=1e-6)
    # Turned by half a turn a corner goes to the opposite one, 2 half diagonals away.
    turned = corners([10, 10, np.pi], [20, 10, np.pi])
    expected = 4 * 2 * 5 + 4 * 2 * np.sqrt(2)
    np.testing.assert_allclose(corner_distances(turned, TRUTH), expected, rtol=1e-5)


def test_corner_distances_broadcast_over_runs_and_tell_what_is_unknown():
    estimate = np.broadcast_to(TRUTH, (3, 4, 2, 4, 2)).copy()
    estimate[1, 2, 0] += [3, 4]
    estimate[2, 0, 1, 3, 0] = np.nan
    truth = np.broadcast_to(TRUTH, (4, 2, 4, 2)).copy()
    truth[3, 0, 0, 0] = np.inf
    got = np.asarray(corner_distances(estimate, truth))
    expected = np.zeros((3, 4))
    expected[1, 2], expected[2, 0], expected[:, 3] = 20, np.nan, np.nan
    np.testing.assert_allclose(got, expected, atol=1e-5)


def test_pose_variance_by_hand():
    # var x + var y + (half diagonal)^2 var theta: 1 + 4 + 25 * .01, and 0 + 9 + 2 * .25.
    spread = np.array([[1, 2, 0.1, 7, 7, 7], [0, 3, 0.5, 7, 7, 7]])
    np.testing.assert_allclose(pose_variance(spread, SIZES), 5.25 + 9.5, rtol=1e-6)
    assert pose_variance(np.zeros((2, 3)), SIZES) == 0
    many = np.broadcast_to(spread, (3, 2, 6)).copy()
    many[1, 0, 1] = np.nan
    many[1, 1, 5] = np.nan
    many[2, 1, 5] = np.nan  # of a joint, which does not count
    got = pose_variance(many, SIZES)
    np.testing.assert_allclose(got, [14.75, np.nan, 14.75], rtol=1e-6)


def test_pose_variance_is_the_mean_squared_distance_of_the_corners():
    rng = np.random.default_rng(0)
    deviations = np.array([[0.5, 0.3, 0.02], [0.2, 0.6, 0.05]])
    poses = np.array([[10, 10, 0.4], [20, 10, -1]]) + deviations * rng.normal(size=(20_000, 2, 3))
    points = np.asarray(corners_from_poses(poses, SIZES), float)
    apart = points - points.mean(axis=0)
    measured = np.sum(np.mean(np.sum(apart**2, axis=-1), axis=(0, 2)))
    stated = pose_variance(poses.std(axis=0), SIZES)
    np.testing.assert_allclose(stated, measured, rtol=0.01)


@pytest.mark.parametrize(("method", "expected"), [("sir", 1), ("ps", 7), ("sps", 4)])
def test_resamplings_per_frame(method, expected):
    ordering = named(method, TREE)
    assert resamplings_per_frame(ordering.resample_after) == expected
    stacked = np.stack([ordering.resample_after] * 3)
    assert resamplings_per_frame(stacked).tolist() == [expected] * 3


def test_measures_work_under_jit():
    rng = np.random.default_rng(1)
    estimate = TRUTH + rng.normal(size=(5, 2, 4, 2))
    for call in (
        lambda: corner_distances(estimate, TRUTH),
        lambda: pose_variance(jnp.abs(estimate[:, :, :3, 0]), SIZES),
    ):
        np.testing.assert_allclose(jax.jit(call)(), call(), rtol=1e-6)
