"""Scenes of points on deforming bodies, and the reader of landmarks."""

import numpy as np
import pytest

import scenes
from scenes.deforming import Pose, bumps

SMALL = {
    "fish": {"num_frames": 50, "frame_width": 480, "frame_height": 270},
    "skydivers": {"num_frames": 4, "frame_width": 400, "frame_height": 300},
    "face": {"num_frames": 4, "frame_width": 640, "frame_height": 400},
}
POINTS = {"fish": 12, "skydivers": 7, "face": 18}


@pytest.mark.parametrize("name", ["fish", "skydivers", "face"])
def test_points_are_on_the_picture(name):
    scene = scenes.make(name, seed=3, **SMALL[name] | {"num_frames": 3})
    points, visible = scene.extras["points"], scene.extras["visible"]
    assert points.shape == (3, POINTS[name], 2)
    assert visible.shape == (3, POINTS[name])
    assert visible[0].all()
    assert len(scene.extras["point_names"]) == POINTS[name]
    # A patch is the window around its point.
    x, y = points[0, 0]
    window = scene.frames[0][int(y) - 10 : int(y) + 11, int(x) - 10 : int(x) + 11]
    np.testing.assert_array_equal(scene.patches[0], window)


def test_the_picture_moves_with_its_points():
    """The windows of two frames resemble each other at the points, and nowhere near."""
    scene = scenes.make("face", seed=1, pixel_noise=0.0, **SMALL["face"])

    def window(t, x, y):
        row, column = int(np.floor(y)), int(np.floor(x))
        return scene.frames[t][row - 10 : row + 11, column - 10 : column + 11].astype(float)

    for point in (2, 9, 14):
        first, last = scene.extras["points"][[0, -1], point]
        here = np.abs(window(3, *last) - window(0, *first)).mean()
        beside = np.abs(window(3, last[0] + 8, last[1] + 8) - window(0, *first)).mean()
        assert here < 0.5 * beside


def test_a_fish_in_front_hides_the_nose():
    visible = scenes.make("fish", seed=2, **SMALL["fish"]).extras["visible"]
    assert visible[0].all()
    assert not visible[15:44, :2].any()


def test_a_bend_is_inverted():
    pose = Pose(50, 40, 1.3, 0.2, bumps(((3, 4), 10.0, (4, -3)), ((-9, 0), 8.0, (2, 2))))
    places = np.random.default_rng(0).uniform(-20, 20, (30, 2))
    np.testing.assert_allclose(pose.to_body(pose.to_image(places)), places, atol=0.1)
