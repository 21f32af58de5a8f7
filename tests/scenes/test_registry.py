"""Scenes by name: what is refused, and what a scene tells about itself."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest

import scenes
from scenes import SceneError

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


def test_unknown_names_parameters_and_seeds_are_refused_with_the_valid_ones():
    assert "distracter" in scenes.names()
    with pytest.raises(SceneError, match=r"'nothing'.*distracter"):
        scenes.make("nothing")
    with pytest.raises(SceneError, match=r"'lambda'.*num_frames.*likeness"):
        scenes.make("distracter", **{"lambda": 20})
    with pytest.raises(SceneError, match="seed = -1"):
        scenes.make("distracter", seed=-1)
    with pytest.raises(SceneError, match=r"seed = 0\.5"):
        scenes.make("distracter", seed=0.5)


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


def test_a_scene_whose_parts_do_not_match_is_refused():
    frames, boxes = np.zeros((3, 8, 9, 3), np.uint8), np.zeros((3, 1, 4))
    patches = [np.zeros((2, 4, 3), np.uint8)]
    good = scenes.Scene("test", frames, boxes, patches, 25.0, {})
    np.testing.assert_array_equal(good.sizes, [[4, 2]])
    with pytest.raises(SceneError, match="uint8"):
        scenes.Scene("test", frames.astype(float), boxes, patches, 25.0, {})
    with pytest.raises(SceneError, match="one row per frame"):
        scenes.Scene("test", frames, boxes[:2], patches, 25.0, {})
    with pytest.raises(SceneError, match="reference patches"):
        scenes.Scene("test", frames, boxes, [], 25.0, {})
