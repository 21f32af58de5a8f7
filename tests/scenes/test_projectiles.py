"""The scene of rowe2005: what the paper fixes holds, and what was chosen is as documented."""

import numpy as np
import pytest

import scenes
from scenes import ProjectilesParameters


@pytest.fixture(scope="module")
def scene():
    return scenes.make("projectiles", seed=3)


def test_the_papers_numbers_hold(scene):
    area = scene.boxes[..., 2] * scene.boxes[..., 3]
    aspect = scene.boxes[..., 3] / scene.boxes[..., 2]
    assert scene.frames.shape == (300, 288, 360, 3)
    assert scene.boxes.shape == (300, 2, 4)
    assert area.min() == pytest.approx(209)
    assert area.max() == pytest.approx(1435)
    assert aspect.min() == pytest.approx(1.3)
    assert aspect.max() == pytest.approx(1.7)


def test_boxes_shrink_for_a_third_and_grow_afterwards(scene):
    change = np.diff(scene.boxes[:, 0, 2:], axis=0)
    assert (change[:99] < 0).all()
    assert (change[101:] > 0).all()
    np.testing.assert_allclose(change[:99], change[:1].repeat(99, 0))


def test_targets_fly_as_gravity_and_friction_say(scene):
    centres = scene.boxes[..., :2] + scene.boxes[..., 2:] / 2
    speed = np.diff(centres, axis=0)
    friction, gravity = scene.parameters["friction"], scene.parameters["gravity"]
    np.testing.assert_allclose(speed[1:, :, 0], (1 - friction) * speed[:-1, :, 0], atol=1e-9)
    np.testing.assert_allclose(
        speed[1:, :, 1], (1 - friction) * speed[:-1, :, 1] + gravity, atol=1e-9
    )
    np.testing.assert_allclose(scene.extras["speeds"][1:], speed)


def gaps(boxes, one, other):
    start = np.maximum(boxes[:, one, :2], boxes[:, other, :2])
    end = np.minimum(
        boxes[:, one, :2] + boxes[:, one, 2:], boxes[:, other, :2] + boxes[:, other, 2:]
    )
    return (start - end).max(axis=1)


@pytest.mark.parametrize(
    ("seed", "num_frames"),
    [(0, 80), *(pytest.param(n, 300, marks=pytest.mark.slow) for n in (1, 2))],
)
def test_targets_stay_in_view_and_apart_or_cross_on_request(seed, num_frames):
    small = {"noise": 0.0, "num_targets": 3, "num_frames": num_frames}
    apart = scenes.make("projectiles", seed=seed, **small).boxes
    assert (apart[..., :2] >= 0).all()
    assert (apart[..., :2] + apart[..., 2:] <= (360, 288)).all()
    assert min(gaps(apart, *pair).min() for pair in ((0, 1), (0, 2), (1, 2))) >= 6
    crossing = scenes.make("projectiles", seed=seed, paths="crossing", **small).boxes
    assert gaps(crossing, 0, 1).min() < 0
    assert gaps(crossing, 1, 2).min() < 0


def test_strips_have_the_targets_statistics_and_the_camera_noise_is_new_in_every_frame():
    scene = scenes.make("projectiles", seed=0, target_deviation=20.0, noise=20.0, num_frames=90)
    grey = scene.frames[..., 0].astype(float)
    for patch, (left, right) in zip(scene.patches, scene.extras["strips"].astype(int), strict=True):
        strip = grey[:, 40:250, left:right].mean(axis=0)  # the noise averages out
        assert strip.mean() == pytest.approx(patch.mean(), abs=10)
        assert strip.std() == pytest.approx(20, rel=0.25)
    corner = grey[:, :16, :16]
    assert np.diff(corner, axis=0).std() == pytest.approx(20 * 2**0.5, rel=0.03)


def test_a_target_looks_like_its_patch_where_its_box_says():
    scene = scenes.make("projectiles", seed=1, noise=0.0, num_frames=30)
    x, y, w, h = scene.boxes[20, 0]
    rows = (np.arange(6) + 0.5) / 6
    columns = (np.arange(4) + 0.5) / 4
    seen = scene.frames[20][np.ix_((y + rows * h).astype(int), (x + columns * w).astype(int))]
    patch = scene.patches[0]
    expected = patch[
        np.ix_((rows * patch.shape[0]).astype(int), (columns * patch.shape[1]).astype(int))
    ]
    np.testing.assert_array_equal(seen, expected)


def test_the_documented_defaults_are_the_classes():
    assert scenes.default_parameters("projectiles")["num_targets"] == 2
    assert ProjectilesParameters().num_frames == 300
