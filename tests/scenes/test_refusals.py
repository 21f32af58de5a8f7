"""What scenes refuse, and what they name: one row for each rule."""

import numpy as np
import pytest
from refusals import message_of

import scenes
from scenes import Scene, SceneError

NAN = float("nan")
CROSSING = {"paths": "crossing", "num_targets": 1}


@pytest.mark.parametrize(
    ("scene", "parameters", "named"),
    [
        ("nothing", {}, "distracter"),
        ("distracter", {"lambda": 20}, "likeness"),
        ("distracter", {"seed": -1}, "seed = -1"),
        ("distracter", {"seed": 0.5}, "seed = 0.5"),
        ("distracter", {"likeness": 1.5}, "likeness = "),
        ("distracter", {"num_objects": 0}, "num_objects = "),
        ("distracter", {"motion_scale": -1.0}, "motion_scale = "),
        ("distracter", {"vanish_frame": 3}, "vanish_frame = "),
        ("distracter", {"brightness": NAN}, "brightness = "),
        ("distracter", {"num_objects": 60}, "fewer or smaller objects"),
        ("articulated", {"num_parts": 4}, "num_parts = 4"),
        ("articulated", {"num_parts": 0}, "num_parts = 0"),
        ("articulated", {"motion": "wild"}, "must be one of smooth, strong_start, erratic"),
        ("articulated", {"swing": NAN}, "swing = nan must be a finite number"),
        ("articulated", {"part_length": 0}, "part_length = 0 must be above 0"),
        ("articulated", {"object_noise": -1.0}, "object_noise = -1.0 must not be negative"),
        ("articulated", {"accent_share": 1.5}, "accent_share = 1.5 must lie between 0 and 1"),
        ("articulated", {"period_spread": 1.0}, "period_spread = 1.0 must lie"),
        ("articulated", {"erratic_longest": 2}, "must be at least erratic_shortest"),
        ("articulated", {"inset": 20.0}, "inset = 20.0 must be at most 14.0"),
        ("articulated", {"frame_width": 120}, "leaves the 120 x 300 frame in frame 0; take fewer"),
        ("wires", {"num_frames": 0}, "num_frames = 0 must be above 0"),
        ("wires", {"wire_width": 2.5}, "wire_width = 2.5 must be a whole number"),
        ("leaves", {"noise": -1}, "noise = -1"),
        ("leaves", {"leaves": 5}, "leaves = 5 must be at most 4"),
        ("leaves", {"leaves": 1}, "leaves = 1 must be at least 2"),
        ("walkers", {"frame_width": 60, "num_frames": 2}, "target 0 leaves the 60 x 240 frame"),
        ("fish", {"num_frames": 1}, "num_frames = 1 must be"),
        ("skydivers", {"growth": -1.0}, "growth"),
        ("face", {"frame_width": 100}, "frame_width"),
        ("projectiles", {"friction": 1.0}, "friction = 1.0 must lie above 0"),
        ("projectiles", {"paths": "near"}, "must be one of apart, crossing, any"),
        ("projectiles", {"reach": (0.5,)}, "must be 2 numbers in a row"),
        ("projectiles", {"reach": (0.9, 0.5)}, "ascending"),
        ("projectiles", {"strips": (0.4, 1.5)}, "must lie between 0 and 1"),
        ("projectiles", CROSSING, "needs more targets"),
        ("projectiles", {"num_targets": 60}, "fewer targets"),
    ],
)
def test_wrong_parameters_are_refused(scene, parameters, named):
    assert named in message_of(scenes.make, scene, error=SceneError, **parameters)


@pytest.mark.parametrize(
    ("frames", "boxes", "patches", "named"),
    [
        (np.zeros((3, 8, 9, 3)), np.zeros((3, 1, 4)), 1, "uint8"),
        (np.zeros((3, 8, 9, 3), np.uint8), np.zeros((2, 1, 4)), 1, "one row per frame"),
        (np.zeros((3, 8, 9, 3), np.uint8), np.zeros((3, 1, 4)), 0, "reference patches"),
    ],
)
def test_a_scene_whose_parts_do_not_match_is_refused(frames, boxes, patches, named):
    patches = [np.zeros((2, 4, 3), np.uint8)] * patches
    message = message_of(Scene, "test", frames, boxes, patches, 25.0, {}, error=SceneError)
    assert named in message
