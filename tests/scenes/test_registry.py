"""Scenes by name, and what a scene tells about itself."""

import ast
import json
from pathlib import Path

import numpy as np

import scenes

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


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


def test_parameters_tell_how_to_make_the_scene_again():
    first = scenes.make("distracter", seed=np.int64(5), **SMALL)
    assert first.parameters["seed"] == 5
    assert first.parameters["num_objects"] == 3
    assert json.loads(json.dumps(first.parameters)) == first.parameters
    again = scenes.make("distracter", **first.parameters)
    np.testing.assert_array_equal(again.frames, first.frames)
    np.testing.assert_array_equal(again.boxes, first.boxes)
    for one, other in zip(again.patches, first.patches, strict=True):
        np.testing.assert_array_equal(one, other)


def test_sizes_are_those_of_the_patches():
    frames, patch = np.zeros((3, 8, 9, 3), np.uint8), np.zeros((2, 4, 3), np.uint8)
    made = scenes.Scene("test", frames, np.zeros((3, 1, 4)), [patch], 25.0, {})
    np.testing.assert_array_equal(made.sizes, [[4, 2]])
    assert "distracter" in scenes.names()
