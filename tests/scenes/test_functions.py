"""Scenes that users' functions make."""

import numpy as np
import pytest
from refusals import message_of

from scenes import Scene, SceneError, open_scene

# Functions

SCENE_FILE = """
from dataclasses import dataclass

import numpy as np

import neighbour
from scenes import Scene, SceneError


@dataclass
class Settings:
    grey: "int"


def flat(seed, grey=7, gap=False):
    value = Settings(grey + seed).grey + neighbour.EXTRA
    frames = np.full((2, 6, 8, 3), value, np.uint8)
    boxes = np.tile([1.0, 1.0, 2.0, 3.0], (2, 1, 1))
    if gap:
        boxes[0] = np.nan
    return Scene("flat", frames, boxes, [frames[0, 1:4, 1:3]], 10.0, {})

def wrong(seed): return {"frames": 3}
def breaks(seed): raise RuntimeError("no\\ncamera")
def complains(seed): raise SceneError("grey = 900 must lie in 0..255")
def no_seed(): pass
def empty(seed):
    return Scene("e", np.zeros((2, 6, 8, 3), np.uint8), np.zeros((2, 0, 4)), [], 10.0, {})
number = 3
"""


def complaint_of(source, **options):
    return message_of(open_scene, source, error=SceneError, **options)


@pytest.fixture
def scene_file(tmp_path):
    (tmp_path / "neighbour.py").write_text("EXTRA = 100\n")
    path = tmp_path / "my_scene.py"
    path.write_text(SCENE_FILE)
    return path


def test_a_function_in_a_file_makes_a_scene(scene_file):
    scene = open_scene(f"{scene_file}:flat", seed=2, parameters={"grey": 30})
    assert scene.name == "flat"
    assert np.all(scene.frames == 132)
    assert np.all(open_scene(f"{scene_file}:flat").frames == 107)


def test_files_of_one_name_are_told_apart(scene_file, tmp_path):
    open_scene(f"{scene_file}:flat")
    other = tmp_path / "other" / "my_scene.py"
    other.parent.mkdir()
    other.write_text(SCENE_FILE.replace("import neighbour\n", "").replace("neighbour.EXTRA", "0"))
    assert np.all(open_scene(f"{other}:flat").frames == 7)


def test_a_function_of_a_module_here_makes_a_scene(scene_file, monkeypatch):
    monkeypatch.chdir(scene_file.parent)
    scene_file.rename(scene_file.parent / "scene_module_here.py")
    assert open_scene("scene_module_here:flat", seed=1).frames[0, 0, 0, 0] == 108


def test_a_python_function_makes_a_scene():
    def recorded(seed):
        frames = np.zeros((2, 6, 8, 3), np.uint8)
        return Scene("r", frames, np.ones((2, 1, 4)), [frames[0]], 10.0, {"seed": seed})

    assert open_scene(recorded, seed=5).parameters == {"seed": 5}


@pytest.mark.parametrize(
    ("name", "options", "complaint"),
    [
        ("wrong", {}, "dict"),
        ("breaks", {}, "RuntimeError: no camera"),
        ("no_seed", {}, "TypeError: no_seed() got an unexpected keyword"),
        ("flat", {"parameters": {"blur": 1}}, "blur"),
        ("flat", {"seed": -1}, "seed = -1"),
        ("flat", {"parameters": {"gap": True}}, "object 1"),
        ("empty", {}, "2 frames and 0 objects"),
        ("flet", {}, "'flet'"),
        ("number", {}, "'number'"),
    ],
)
def test_a_function_that_makes_no_scene_is_refused(scene_file, name, options, complaint):
    message = complaint_of(f"{scene_file}:{name}", **options)
    assert complaint in message


def test_what_a_function_says_about_its_parameters_is_handed_on(scene_file):
    assert complaint_of(f"{scene_file}:complains") == "grey = 900 must lie in 0..255"


def test_functions_that_cannot_be_imported_are_named(scene_file, tmp_path):
    assert "there is no file nowhere.py" in complaint_of("nowhere.py:flat")
    message = complaint_of("no_such_package.module:flat")
    assert "'no_such_package.module:flat'" in message
    assert "No module named 'no_such_package'" in message
    scene_file.write_text("import no_such_package\n")
    assert "cannot be imported (ModuleNotFoundError" in complaint_of(f"{scene_file}:flat")
    scene_file.write_text("def flat(seed:\n")
    assert "cannot be imported (SyntaxError" in complaint_of(f"{scene_file}:flat")
    scene_file.write_bytes(b"# caf\xe9\n")
    assert "cannot be imported (UnicodeDecodeError" in complaint_of(f"{scene_file}:flat")
