"""What scenes refuse, and what they name: one row for each rule."""

import numpy as np
import pytest
from refusals import message_of

import scenes
from scenes import Scene, SceneError

NAN = float("nan")

#: Scene -> parameters, of which the refusal names the first.
ALONE = {
    "distracter": [{"seed": -1}, {"num_objects": 0}, {"vanish_frame": 3}, {"brightness": NAN}],
    "articulated": [{"num_parts": 4}, {"motion": "wild"}, {"inset": 20.0}, {"erratic_longest": 2}],
    "wires": [{"wire_width": 2.5}],
    "leaves": [{"noise": -1}, {"leaves": 5}],
    "projectiles": [{"friction": 1.0}, {"reach": (0.5,)}, {"reach": (0.9, 0.5)}, {"strips": (2,)}],
}
TOGETHER = [
    ("nothing", {}, "distracter"),
    ("distracter", {"lambda": 20}, "likeness"),
    ("distracter", {"num_objects": 60}, "fewer or smaller objects"),
    ("articulated", {"frame_width": 120}, "120 x 300"),
    ("walkers", {"frame_width": 60, "num_frames": 2}, "60 x 240"),
    ("projectiles", {"paths": "crossing", "num_targets": 1}, "more targets"),
    ("projectiles", {"num_targets": 60}, "fewer targets"),
]


@pytest.mark.parametrize(
    ("scene", "parameters", "named"),
    [
        *(
            (scene, wrong, f"{next(iter(wrong))} = ")
            for scene, rows in ALONE.items()
            for wrong in rows
        ),
        *TOGETHER,
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
