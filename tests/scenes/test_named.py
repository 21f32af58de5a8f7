"""Scenes by name: made again from what they tell about themselves, or refused by one sentence."""

import ast
import json
from pathlib import Path

import jax
import numpy as np
import pytest
from refusals import message_of

import scenes
from scenes import Scene, SceneError

FEW = {"num_frames": 4}
SMALL = {"distracter": {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}}


def test_scenes_import_nothing_of_the_library():
    for path in Path(scenes.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                imported = [node.module or ""]
            else:
                continue
            assert not any(name.split(".")[0] in ("jaxpf", "jax") for name in imported), path


@pytest.mark.parametrize("name", scenes.names())
def test_seed_and_parameters_make_the_scene_again(name):
    first = scenes.make(name, seed=np.int64(5), **SMALL.get(name, FEW))
    assert first.parameters["seed"] == 5
    kept = json.loads(json.dumps(first.parameters))
    again, other = (scenes.make(name, **kept | {"seed": seed}) for seed in (5, 6))
    for part in ("frames", "boxes", "patches"):
        jax.tree.map(np.testing.assert_array_equal, getattr(first, part), getattr(again, part))
    for part in first.extras.keys() & {"outlines", "corners", "points"}:
        np.testing.assert_array_equal(first.extras[part], again.extras[part])
    assert not np.array_equal(first.frames, other.frames)


@pytest.mark.parametrize(
    ("name", "noise"),
    [("distracter", "object_noise"), ("articulated", "object_noise"), ("projectiles", "noise")],
)
def test_pixel_noise_does_not_change_the_paths(name, noise):
    calm, noisy = (scenes.make(name, **{noise: x}, **SMALL.get(name, FEW)) for x in (0.0, 30.0))
    np.testing.assert_array_equal(calm.boxes, noisy.boxes)
    assert not np.array_equal(calm.frames, noisy.frames)


#: Scene -> parameters, of which the refusal names the first.
ALONE = {
    "distracter": [
        {"seed": -1},
        {"num_objects": 0},
        {"vanish_frame": 3},
        {"brightness": float("nan")},
    ],
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
