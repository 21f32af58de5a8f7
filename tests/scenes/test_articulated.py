"""The articulated scene: parts stay attached, the truth fits the pictures, motions differ."""

import numpy as np
import pytest

import scenes
from scenes.articulated import Articulated


def make(seed=3, **parameters):
    return scenes.make("articulated", seed=seed, **({"num_frames": 8} | parameters))


def turned(vectors, angles):
    """Clockwise in the image, by complex numbers."""
    product = (vectors[..., 0] + 1j * vectors[..., 1]) * np.exp(1j * np.asarray(angles))
    return np.stack([product.real, product.imag], axis=-1)


@pytest.mark.parametrize("motion", ["smooth", "strong_start", "erratic"])
@pytest.mark.parametrize("num_parts", [1, 7, 11])
def test_every_joint_holds_in_every_frame(num_parts, motion):
    scene = make(num_parts=num_parts, motion=motion)
    poses, parents = scene.extras["poses"], scene.extras["parents"]
    assert parents == (-1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8)[:num_parts]
    for part, parent in list(enumerate(parents))[1:]:
        joints = [
            poses[:, which, :2] + turned(scene.extras[f"{whose}_anchors"][part], poses[:, which, 2])
            for which, whose in ((parent, "parent"), (part, "part"))
        ]
        np.testing.assert_allclose(*joints, atol=1e-9)
        bend = np.abs(poses[:, part, 2] - poses[:, parent, 2])
        assert bend.max() <= np.deg2rad(Articulated.swing) + 1e-9


def test_corners_and_boxes_describe_the_poses():
    scene = make()
    corners, poses = scene.extras["corners"], scene.extras["poses"]
    for number, (width, height) in enumerate(scene.sizes):
        upright = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, height / 2)
        expected = poses[:, number, None, :2] + turned(upright, poses[:, number, None, 2])
        np.testing.assert_allclose(corners[:, number], expected, atol=1e-9)
    np.testing.assert_allclose(scene.boxes[..., :2], corners.min(axis=2))
    np.testing.assert_allclose(scene.boxes[..., :2] + scene.boxes[..., 2:], corners.max(axis=2))


def test_pixels_inside_a_part_show_it_and_pixels_outside_show_the_background():
    scene = make(object_noise=0.0, background_noise=0.0, accent_share=0.0)
    for frame, poses in zip(scene.frames, scene.extras["poses"], strict=True):
        rows, columns = np.mgrid[: frame.shape[0], : frame.shape[1]] + 0.5
        covered = np.zeros(frame.shape[:2], bool)
        for part in range(scene.num_objects):  # the centre lies on top
            inner = turned(np.stack([columns, rows], -1) - poses[part, :2], -poses[part, 2])
            inside = (np.abs(inner) < scene.sizes[part] / 2 - 1e-6).all(axis=-1)
            colour = scene.patches[part][0, 0]
            assert (frame[inside & ~covered] == colour).all()
            covered |= (np.abs(inner) <= scene.sizes[part] / 2 + 1e-6).all(axis=-1)
        assert (frame[~covered] == 128).all()


def test_motions_differ_as_the_paper_says():
    """By how far every corner moves from frame to frame."""

    def steps(seed, motion):
        corners = make(seed, num_parts=5, motion=motion, num_frames=120).extras["corners"]
        return np.linalg.norm(np.diff(corners, axis=0), axis=-1).mean(axis=-1)

    smooth, strong, erratic = (
        np.concatenate([steps(seed, motion) for seed in range(2)], axis=1)
        for motion in ("smooth", "strong_start", "erratic")
    )
    assert 2 * smooth[:40].mean() < strong[:40].mean()
    # After the beginning it is the same path at the same speed.
    assert 0.7 < strong[60:].mean() / smooth[60:].mean() < 1.3
    assert 2 * smooth.mean() < erratic.mean()
    changes = [np.abs(np.diff(motion, axis=0)).mean() for motion in (smooth, erratic)]
    assert 5 * changes[0] < changes[1]


def test_a_strong_start_runs_through_the_smooth_path_faster():
    calm = make(4, num_frames=40, strong_factor=3.0)
    strong = make(4, num_frames=10, strong_factor=3.0, motion="strong_start")
    np.testing.assert_allclose(strong.extras["poses"], calm.extras["poses"][::3][:10], atol=1e-9)


def test_neighbouring_parts_look_different():
    scene = make(num_parts=11)
    colours = np.array([patch.reshape(-1, 3).mean(axis=0) for patch in scene.patches])
    for part, parent in enumerate(scene.extras["parents"]):
        if parent >= 0:
            assert np.abs(colours[part] - colours[parent]).max() > 40
