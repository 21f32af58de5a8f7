"""The scene of rowe2005: what the paper fixes holds, and what was chosen is as documented."""

import numpy as np
import pytest

import scenes


@pytest.fixture(scope="module")
def scene():
    return scenes.make("projectiles", seed=3)


def test_the_papers_numbers_hold(scene):
    sizes = scene.boxes[..., 2:]
    area, aspect = sizes.prod(axis=-1), sizes[..., 1] / sizes[..., 0]
    assert scene.frames.shape == (300, 288, 360, 3)
    assert [area.min(), area.max()] == pytest.approx([209, 1435])
    assert [aspect.min(), aspect.max()] == pytest.approx([1.3, 1.7])
    change = np.diff(sizes[:, 0], axis=0)  # smaller for a third, then larger
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


def test_targets_stay_in_view_and_apart_or_cross_on_request():
    small = {"noise": 0.0, "num_targets": 3, "num_frames": 80}
    apart = scenes.make("projectiles", **small).boxes
    assert (apart[..., :2] >= 0).all()
    assert (apart[..., :2] + apart[..., 2:] <= (360, 288)).all()
    assert min(gaps(apart, *pair).min() for pair in ((0, 1), (0, 2), (1, 2))) >= 6
    crossing = scenes.make("projectiles", paths="crossing", **small).boxes
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
    patch, (x, y, w, h) = scene.patches[0], scene.boxes[20, 0]
    rows, columns = (np.arange(6) + 0.5) / 6, (np.arange(4) + 0.5) / 4

    def at(picture, x, y, w, h):
        return picture[np.ix_((y + rows * h).astype(int), (x + columns * w).astype(int))]

    seen, expected = at(scene.frames[20], x, y, w, h), at(patch, 0, 0, *patch.shape[1::-1])
    np.testing.assert_array_equal(seen, expected)
