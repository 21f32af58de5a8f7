"""Baselines: they follow what they should, by name, and say what is missing."""

import os
import pickle
import sys

import cv2
import numpy as np
import pytest
from refusals import message_of

import scenes
from jaxpf.evaluation.baselines.rivals import available, baselines

LENGTH = 12
#: Those that are there everywhere and, unlike MIL, draw no samples.
NAMES = ("meanshift", "still")


def moving_scene(edge=False):
    """Two coloured, textured objects on the move over grey noise; one may cross the rim."""
    rng = np.random.default_rng(3)
    frames = rng.integers(100, 130, (LENGTH, 160, 240, 3), dtype=np.uint8)
    coarse = rng.integers(0, 80, (2, 5, 5, 3), dtype=np.uint8)
    textures = coarse.repeat(8, axis=1).repeat(8, axis=2)
    textures[0, ..., 0] += 170
    textures[1, ..., 2] += 170
    boxes = np.empty((LENGTH, 2, 4))
    for time, frame in enumerate(frames):
        places = (20 + 3 * time, 20 + time), (190 + (3 if edge else -3) * time, 110 - time)
        for index, (x, y) in enumerate(places):
            boxes[time, index] = x, y, 40, 40
            frame[y : y + 40, x : x + 40] = textures[index, :, : 240 - x]
    patches = [scenes.cut_patch(frames[0], box) for box in boxes[0]]
    return scenes.Scene("moving", frames, boxes, patches, 25.0, {})


@pytest.fixture(scope="module")
def scene():
    return moving_scene()


def overlaps(boxes, truth):
    ends = np.minimum(*(b[..., :2] + b[..., 2:] for b in (boxes, truth)))
    common = np.prod(np.clip(ends - np.maximum(boxes[..., :2], truth[..., :2]), 0, None), -1)
    return common / (np.prod(boxes[..., 2:], -1) + np.prod(truth[..., 2:], -1) - common)


@pytest.mark.parametrize("name", NAMES)
def test_a_baseline_gives_boxes_of_all_frames_and_the_same_again(scene, name):
    follow = baselines([name])[name]
    boxes = follow(scene)
    assert boxes.shape == scene.boxes.shape
    np.testing.assert_array_equal(boxes[0], scene.boxes[0])
    again = pickle.loads(pickle.dumps(follow))(moving_scene())
    np.testing.assert_array_equal(again, boxes)


@pytest.mark.parametrize("name", ["mil", "dlib", "meanshift"])
def test_trackers_follow_objects_that_move_and_survive_those_that_leave(scene, name):
    boxes = baselines([name])[name](scene)
    assert overlaps(boxes, scene.boxes)[-1].min() > 0.35
    assert overlaps(scene.boxes[:1], scene.boxes)[-1].max() < 0.1, "they do move"
    leaving = moving_scene(edge=True)
    boxes = baselines([name])[name](leaving)
    assert boxes.shape == leaving.boxes.shape
    assert np.isfinite(boxes).all()


def test_still_boxes_stay(scene):
    still = baselines(["still"])["still"]
    boxes = still(scene)
    np.testing.assert_array_equal(boxes, np.tile(scene.boxes[:1], (LENGTH, 1, 1)))


def test_the_truth_after_the_first_frame_is_not_looked_at(scene):
    blind = scene.boxes.copy()
    blind[1:] = np.nan
    hidden = scenes.Scene("hidden", scene.frames, blind, scene.patches, 25.0, {})
    for name in NAMES:
        follow = baselines([name])[name]
        np.testing.assert_array_equal(follow(hidden), follow(scene))


def test_unknown_and_missing_baselines_are_one_sentence(scene, monkeypatch):
    assert "'best'" in message_of(baselines, ["mil", "best"])
    for place in (cv2, getattr(cv2, "legacy", cv2)):
        monkeypatch.delattr(place, "TrackerCSRT_create", raising=False)
        monkeypatch.setattr(place, "TrackerKCF_create", object, raising=False)
    assert "opencv-contrib" in message_of(baselines(["csrt"])["csrt"], scene)
    names = available()
    assert {"kcf", "meanshift", "still"} <= set(names)
    assert "csrt" not in names


def test_boxes_without_features_for_mil_are_refused_and_others_end(scene):
    """OpenCV would look for a feature for ever."""

    def narrow(width, height):
        boxes = np.tile([20.0, 20, width, height], (2, 1, 1))
        return scenes.Scene("narrow", scene.frames[:2], boxes, scene.patches[:1], 25.0, {})

    mil = baselines(["mil"])["mil"]
    assert mil(narrow(3, 6)).shape == (2, 1, 4)
    for size in ((1, 40), (3, 5)):
        assert f"{size[0]}x" in message_of(mil, narrow(*size))


@pytest.mark.parametrize(("kind", "variable"), [("vit", "JAXPF_VIT"), ("nano", "JAXPF_NANO")])
def test_networks_of_opencv_follow_with_a_model_of_the_users(scene, kind, variable):
    files = os.environ.get(variable)
    if files is None:
        pytest.skip(f"{variable} names no model file")
    boxes = baselines([f"{kind}:{files}"])[kind](scene)
    assert overlaps(boxes, scene.boxes)[-1].min() > 0.35


@pytest.mark.parametrize("name", ["vit", "vit:no.onnx", "nano:no.onnx", "dlib:no.dat"])
def test_a_network_without_its_files_is_refused(name):
    assert f"'{name}'" in message_of(baselines, [name])


def test_a_missing_dlib_names_its_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "dlib", None)
    assert "dlib-bin" in message_of(baselines(["dlib"])["dlib"], moving_scene(edge=True))
