"""The distracter scene: the paper's defaults, the layout, the pictures."""

import cv2
import numpy as np
import pytest

import scenes

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


def crop(frame, box):
    """The pixels of a box, at the nearest whole pixel."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    return frame[top : top + int(box[3]), left : left + int(box[2])]


def squared_distance(one, other):
    """Bhattacharyya's d^2 of hue and saturation, over both halves: 0 alike, 2 nothing common."""
    total = 0
    for halves in zip(np.split(one, [21]), np.split(other, [21]), strict=True):
        shares = []
        for half in halves:
            hsv = cv2.cvtColor(half.astype(np.float32) / 255, cv2.COLOR_RGB2HSV)
            hue, saturation = hsv[..., 0].ravel(), hsv[..., 1].ravel()
            counts = np.histogram2d(hue, saturation, bins=10, range=[[0, 360], [0, 1]])[0]
            shares.append(counts / counts.sum())
        total += 1 - np.sqrt(shares[0] * shares[1]).sum()
    return total


def boxes_gap(one, other):
    """The larger of the gaps in x and in y, negative if the boxes meet."""
    start, end = one[..., :2], one[..., :2] + one[..., 2:]
    start2, end2 = other[..., :2], other[..., :2] + other[..., 2:]
    return np.max(np.maximum(start, start2) - np.minimum(end, end2), axis=-1)


@pytest.fixture(scope="module")
def scene():
    return scenes.make("distracter", seed=1)


def test_the_defaults_are_those_of_the_paper(scene):
    assert scene.frames.shape == (25, 288, 360, 3)
    np.testing.assert_array_equal(scene.sizes, [[32, 42]] * 7)
    # "Appears in frame 3 and disappears in frame 9", counted from 1: drawn in 3, ..., 8.
    shown = np.isfinite(scene.extras["distracter_boxes"]).all(axis=1)
    assert (np.nonzero(shown)[0] + 1).tolist() == [3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize("seed", range(3))
def test_objects_stay_in_view_and_apart(seed):
    scene = scenes.make("distracter", seed=seed)
    left_top, right_bottom = scene.boxes[..., :2], scene.boxes[..., :2] + scene.boxes[..., 2:]
    assert (left_top >= 2).all()
    assert (right_bottom <= np.array([360, 288]) - 2).all()
    for one in range(7):
        for other in range(one):
            assert (boxes_gap(scene.boxes[:, one], scene.boxes[:, other]) >= 6 - 1e-9).all()
    shown = scene.extras["distracter_boxes"]
    for other in range(1, 7):
        assert np.nanmin(boxes_gap(shown, scene.boxes[:, other])) >= 6 - 1e-9


def test_the_distracter_covers_object_1_then_leads_away_in_a_straight_line():
    scene = scenes.make("distracter", seed=2, lead_distance=50.0)
    shown = scene.extras["distracter_boxes"][2:8]
    np.testing.assert_allclose(shown[0], scene.boxes[2, 0])
    # It ends 50 pixels away, on the far side of where object 1 came from.
    moved = scene.boxes[7, 0, :2] - scene.boxes[2, 0, :2]
    gap = shown[-1, :2] - scene.boxes[7, 0, :2]
    np.testing.assert_allclose(np.hypot(*gap), 50)
    np.testing.assert_allclose(gap @ moved, -50 * np.hypot(*moved))
    assert np.hypot(*moved) >= scene.parameters["leader_travel"]
    steps = np.diff(shown[:, :2], axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to(steps[0], steps.shape), atol=1e-9)


def test_object_1_departs_from_where_the_distracter_vanished():
    distances = {}
    for departure in (0.0, 60.0):
        scene = scenes.make("distracter", seed=3, lead_distance=25.0, departure=departure)
        vanished = scene.extras["distracter_boxes"][7, :2]
        distances[departure] = np.hypot(*(scene.boxes[-1, 0, :2] - vanished))
    assert distances[0.0] < 60 <= distances[60.0]


def test_the_frames_show_what_the_truth_says():
    scene = scenes.make("distracter", seed=3, object_noise=0.0)
    shown = scene.extras["distracter_boxes"]
    for frame in range(scene.num_frames):
        for number in range(1, 7):
            seen = crop(scene.frames[frame], scene.boxes[frame, number])
            np.testing.assert_array_equal(seen, scene.patches[number])
        if np.isfinite(shown[frame]).all():
            seen = crop(scene.frames[frame], shown[frame])
            np.testing.assert_array_equal(seen, scene.extras["distracter_patch"])
        else:
            seen = crop(scene.frames[frame], scene.boxes[frame, 0])
            np.testing.assert_array_equal(seen, scene.extras["object_patch"])


def test_motion_is_autoregressive_with_the_stated_noise():
    # One small object in a wide frame and no distracter: nothing is ever redrawn.
    alone = {"num_objects": 1, "appear_frame": 50, "vanish_frame": 51, "start_jitter": 0.0}
    small = {"object_width": 4, "object_height": 4, "frame_width": 300, "frame_height": 300}
    tracks = [
        scenes.make("distracter", seed=seed, num_frames=30, **alone, **small).boxes[:, 0, :2]
        for seed in range(20)
    ]
    steps = [np.diff(track, axis=0) for track in tracks]
    before = np.concatenate([track[:-1] for track in steps]).ravel()
    after = np.concatenate([track[1:] for track in steps]).ravel()
    # Standard errors with 20 * 28 * 2 = 1120 steps: of the momentum sqrt((1 - .25) / 1120) =
    # .026, of the noise 3 / sqrt(2 * 1120) = .063.
    momentum = (before @ after) / (before @ before)
    assert abs(momentum - 0.5) < 0.1
    assert abs(np.std(after - 0.5 * before) - 3) < 0.25


def test_the_first_template_prefers_the_distracter_and_then_object_1(scene):
    template = scene.patches[0]
    to_distracter = squared_distance(template, scene.extras["distracter_patch"])
    to_object = squared_distance(template, scene.extras["object_patch"])
    background = scenes.make("distracter", seed=1, num_objects=1).frames[-1][:42, :32]
    others = [squared_distance(template, patch) for patch in scene.patches[1:]]
    assert to_distracter < 0.05
    assert to_distracter + 0.1 < to_object
    assert to_object + 0.2 < min(others)
    assert to_object + 0.3 < squared_distance(template, background)


def test_every_object_matches_its_own_template_best(scene):
    for number in range(1, 7):
        seen = crop(scene.frames[-1], scene.boxes[-1, number])
        distances = [squared_distance(seen, patch) for patch in scene.patches]
        assert np.argmin(distances) == number
        assert sorted(distances)[1] > distances[number] + 0.3
        upside_down = np.concatenate([seen[21:], seen[:21]])
        assert squared_distance(upside_down, scene.patches[number]) > 1


@pytest.mark.parametrize("likeness", [0.0, 0.5, 1.0])
def test_likeness_is_the_share_of_common_colour(likeness):
    scene = scenes.make("distracter", likeness=likeness, object_noise=0.0, **SMALL)
    same = (scene.extras["distracter_patch"] == scene.extras["object_patch"]).all(axis=-1)
    # Whole cells of 4 x 4, some cut at the edge of a half: not exact to the pixel.
    assert abs(same.mean() - likeness) < 0.04
    assert abs(same[:21].mean() - same[21:].mean()) < 0.08


def test_background_noise_is_as_stated():
    scene = scenes.make("distracter", background_mean=120.0, background_noise=20.0, **SMALL)
    # The margin of 2 pixels is free of objects.
    pixels = np.concatenate([scene.frames[0, :2].ravel(), scene.frames[0, -2:].ravel()])
    # 2160 values: standard errors 20 / sqrt(2160) = .43 and .30.
    assert abs(pixels.mean() - 120) < 2
    assert abs(pixels.std() - 20) < 1.5
    coarse = scenes.make("distracter", background_grain=2, **SMALL).frames[0]
    np.testing.assert_array_equal(coarse[0], coarse[1])
