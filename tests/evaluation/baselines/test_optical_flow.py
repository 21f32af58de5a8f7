"""Optical flow on pictures whose motion is known."""

import numpy as np

from jaxpf.evaluation.baselines.optical_flow import follow_points

RNG = np.random.default_rng(0)
PICTURE = np.kron(RNG.integers(0, 256, (20, 26, 3), dtype=np.uint8), np.ones((6, 6, 1), np.uint8))
POINTS = np.array([[40.5, 40.5], [70.5, 45.5], [55.5, 75.5]])
FRAMES = [np.roll(PICTURE, (t, 2 * t), axis=(0, 1)) for t in range(7)]


def test_optical_flow_follows_points_and_says_when_it_does_not():
    places, followed = follow_points(FRAMES, POINTS)
    assert followed.all()
    np.testing.assert_allclose(
        places, POINTS + np.arange(1, 7)[:, None, None] * np.array([2.0, 1.0]), atol=0.1
    )
    cut = [*FRAMES[:3], np.zeros_like(PICTURE)]
    places, followed = follow_points(cut, POINTS)
    assert not followed[-1].any()
    np.testing.assert_array_equal(places[-1], places[-2])
