"""Test sequences for trackers: synthetic scenes, and readers of annotated real clips.

A scene is frames, ground truth and reference patches.  ``open_scene(source)`` opens any scene: by
name, from a folder, or from a user's function.  ``names()`` lists the synthetic scenes,
``make(name, seed)`` generates one, ``open_folder(folder)`` opens a real sequence.  This package
does not depend on trackers.
"""

import dataclasses
import operator
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenes.articulated import ArticulatedParameters, articulated_scene
from scenes.benchmark_clips import read_mot, read_otb
from scenes.clips import Clip, cut_patch, read_clip
from scenes.distracter import distracter_scene
from scenes.distracter_parameters import DistracterParameters
from scenes.face import FaceParameters, face_scene
from scenes.fish import FishParameters, fish_scene
from scenes.frames import LazyFrames
from scenes.leaves import LeavesParameters, leaves_scene
from scenes.projectiles import ProjectilesParameters, projectiles_scene
from scenes.scene import Scene, SceneError
from scenes.sequences import (
    call_scene,
    cause_of,
    function_of_text,
    names_function,
    open_folder,
    start_scene,
)
from scenes.skydivers import SkydiversParameters, skydivers_scene
from scenes.street import puppet_scene, street_scene
from scenes.walkers import WalkersParameters, walkers_scene
from scenes.wires import WiresParameters, wires_scene

__all__ = [
    "ArticulatedParameters",
    "Clip",
    "DistracterParameters",
    "FaceParameters",
    "FishParameters",
    "LazyFrames",
    "LeavesParameters",
    "ProjectilesParameters",
    "Scene",
    "SceneError",
    "SkydiversParameters",
    "WalkersParameters",
    "WiresParameters",
    "articulated_scene",
    "cause_of",
    "cut_patch",
    "default_parameters",
    "distracter_scene",
    "face_scene",
    "fish_scene",
    "function_of_text",
    "leaves_scene",
    "make",
    "names",
    "open_folder",
    "open_scene",
    "projectiles_scene",
    "puppet_scene",
    "read_clip",
    "read_mot",
    "read_otb",
    "skydivers_scene",
    "start_scene",
    "street_scene",
    "walkers_scene",
    "wires_scene",
]

# name -> class of the parameters, and function of (parameters, seed) that generates the scene
_REGISTRY: dict[str, tuple[type, Callable[[Any, int], Scene]]] = {
    "articulated": (ArticulatedParameters, articulated_scene),
    "distracter": (DistracterParameters, distracter_scene),
    "projectiles": (ProjectilesParameters, projectiles_scene),
    "face": (FaceParameters, face_scene),
    "fish": (FishParameters, fish_scene),
    "skydivers": (SkydiversParameters, skydivers_scene),
    "leaves": (LeavesParameters, leaves_scene),
    "walkers": (WalkersParameters, walkers_scene),
    "wires": (WiresParameters, wires_scene),
}


def names() -> list[str]:
    """Return the names of the synthetic scenes, sorted."""
    return sorted(_REGISTRY)


def default_parameters(name: str) -> dict[str, Any]:
    """Return the parameters of a scene with their defaults."""
    parameters_class, _ = _look_up(name)
    return dataclasses.asdict(parameters_class())


def make(name: str, seed: int = 0, **parameters: Any) -> Scene:
    """Generate the scene ``name``; omitted parameters keep their defaults.

    The same name, seed and parameters give the same scene, bit for bit.
    """
    parameters_class, draw = _look_up(name)
    valid = default_parameters(name)
    unknown = sorted(set(parameters) - set(valid))
    if unknown:
        raise SceneError(
            f"scene {name!r} has no parameter {', '.join(map(repr, unknown))}; "
            f"it has {', '.join(valid)}"
        )
    return draw(parameters_class(**parameters), _whole_seed(name, seed))


def open_scene(
    source: str | Path | Callable[..., Any],
    *,
    seed: int = 0,
    ids: Sequence[int] | None = None,
    start_frame: int | None = None,
    num_frames: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Scene:
    """Open a scene from any source.

    Args:
        source: one of

            * a name that ``names()`` lists;
            * a folder with an annotated sequence: ``meta.json`` and ``gt.csv``, or a
              MOTChallenge or an OTB sequence (``open_folder``); write ``./distracter`` for a
              folder with the name of a registered scene;
            * a function that returns a ``Scene``, or its location,
              ``path/to/file.py:function`` or ``package.module:function`` (``call_scene``).
        seed: of registered scenes and functions; ignored for a folder.
        ids: for folders, the objects, in this order; by default all objects in view in the start
            frame or, if none is given, in the first frame with any object.
        start_frame: for folders, the first frame of the scene, counting from 0; by default the
            first frame with all chosen objects in view.
        num_frames: for folders, number of frames from there; by default all.
        parameters: of registered scenes and functions, by name.

    Returns:
        The scene.  From a folder it begins with the start frame; the reference patches are cut
        from the true boxes there, and ``extras`` has ``ids``, ``start_frame``, ``source`` and
        ``occlusion``.  Boxes that extend beyond the picture stay whole; their patches are the
        part inside (``start_scene``).

    Raises:
        SceneError: an unknown scene, a missing file, a malformed line, an absent object, or a
            failing function; the message says which.
    """
    given = dict(parameters or {})
    if isinstance(source, str | Path) and _is_folder(source):
        if given:
            raise SceneError(
                f"{source} is a recorded sequence and has no parameters, but "
                f"{', '.join(map(repr, given))} was given"
            )
        return start_scene(open_folder(source), ids, start_frame, num_frames)
    for name, value in {"ids": ids, "start_frame": start_frame, "num_frames": num_frames}.items():
        if value is not None:
            raise SceneError(
                f"chooses from a recorded sequence, but the scene {source!r} is drawn by a "
                "function; set its own parameters instead",
                (name, value),
            )
    if callable(source):
        return call_scene(source, _whole_seed(str(source), seed), given)
    text = str(source)
    if text not in _REGISTRY and names_function(text):
        return call_scene(text, _whole_seed(text, seed), given)
    return make(text, seed, **given)


def _is_folder(source: str | Path) -> bool:
    """Whether ``source`` is or looks like a folder, and is neither a name nor a function."""
    if source in _REGISTRY:
        return False
    if Path(source).exists():
        return True
    return not names_function(str(source)) and (isinstance(source, Path) or "/" in source)


def _whole_seed(name: str, seed: int) -> int:
    try:
        whole_seed = operator.index(seed)
    except TypeError:
        whole_seed = -1
    if whole_seed < 0:
        raise SceneError(f"scene {name!r}: seed = {seed!r} must be a whole number, 0 or more")
    return whole_seed


def _look_up(name: str) -> tuple[type, Callable[[Any, int], Scene]]:
    if name not in _REGISTRY:
        raise SceneError(
            f"no scene {name!r}; the scenes are {', '.join(names())}, and a folder with an "
            "annotated sequence or a function, file.py:function, can be given as well"
        )
    return _REGISTRY[name]
