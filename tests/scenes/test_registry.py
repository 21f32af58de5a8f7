"""Scenes by name, and what a scene tells about itself."""

import ast
import json
from pathlib import Path

import jax
import numpy as np
import pytest

import scenes

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
