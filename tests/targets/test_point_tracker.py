"""Points followed by every filter, from the same start."""

import jax
import numpy as np
import pytest

import jaxpf
from jaxpf.media.points_overlay import draw_points
from jaxpf.targets.points import METHODS, point_tracker

RNG = np.random.default_rng(0)
PICTURE = np.kron(RNG.integers(30, 256, (20, 26, 3), dtype=np.uint8), np.ones((6, 6, 1), np.uint8))
POINTS = np.array([[40.5, 40.5], [70.5, 45.5], [55.5, 75.5]])
FRAMES = np.stack([np.roll(PICTURE, 2 * t, axis=1) for t in range(1, 9)])


@pytest.mark.parametrize("method", METHODS)
def test_every_filter_follows_points(method):
    tracker = point_tracker(PICTURE, POINTS, method=method, scale=3.0)
    _, summary = jaxpf.run(tracker, jax.random.key(0), FRAMES)
    truth = POINTS + np.arange(2, 18, 2)[:, None, None] * np.array([1.0, 0.0])
    assert np.linalg.norm(summary.estimate - truth, axis=-1).mean() < 2.5


@pytest.mark.parametrize(
    ("points", "changes", "message"),
    [
        (POINTS, {"method": "dps"}, "method 'dps' is unknown for points"),
        (POINTS, {"speed": 3}, "there is no option 'speed'"),
        (POINTS, {"scale": -1.0}, "scale -1.0 must be finite"),
        (POINTS, {"window": 2001}, "the window is 2001 x 2001 pixels and the frame 156 x 120"),
        (POINTS[:1], {}, "two partitions or more"),
        (POINTS[[0, 0]], {"method": "pffl"}, "points 0 and 1 are both at"),
        (POINTS + 100, {}, "outside the frame"),
    ],
)
def test_bad_input_is_refused(points, changes, message):
    with pytest.raises(jaxpf.InputError, match=message):
        point_tracker(PICTURE, points, **changes)


def test_hidden_points_are_drawn_hollow():
    black = np.zeros((60, 60, 3), np.uint8)
    drawn = draw_points(
        black,
        [[15.5, 15.5], [45.5, 15.5], [np.nan, 3]],
        trails=np.full((3, 3, 2), 30.0),
        particles=np.full((2, 3, 2), 50.0),
        hidden=[False, True, False],
    )
    assert not black.any()
    assert drawn[15, 15].any()
    assert not drawn[15, 45].any()
    assert drawn[15, 41].any()
    assert drawn[50, 50].any()
