"""Test sequences for trackers: synthetic scenes.

A scene is frames, ground truth and reference patches.  ``open_scene(source)`` opens any scene, by
name or from a user's function.  ``names()`` lists the synthetic scenes, ``make(name, seed)``
generates one.  This package does not depend on trackers; ``jaxpf.sequences`` reads recordings.
"""

import dataclasses
import difflib
from collections.abc import Callable, Mapping
from typing import Any

from scenes.articulated import ArticulatedParameters, articulated_scene
from scenes.distracter import DistracterParameters, distracter_scene
from scenes.face import FaceParameters, face_scene
from scenes.fish import FishParameters, fish_scene
from scenes.functions import call_scene, cause_of, function_of_text, names_function
from scenes.leaves import LeavesParameters, leaves_scene
from scenes.parameters import Parameters
from scenes.projectiles import ProjectilesParameters, projectiles_scene
from scenes.scene import Scene, SceneError, cut_patch
from scenes.skydivers import SkydiversParameters, skydivers_scene
from scenes.street import puppet_scene, street_scene
from scenes.walkers import WalkersParameters, walkers_scene
from scenes.wires import WiresParameters, wires_scene

__all__ = [
    "ArticulatedParameters",
    "DistracterParameters",
    "ProjectilesParameters",
    "Scene",
    "SceneError",
    "cause_of",
    "cut_patch",
    "default_parameters",
    "function_of_text",
    "make",
    "names",
    "names_function",
    "open_scene",
    "puppet_scene",
    "street_scene",
]

# name -> class of the parameters, and function of (parameters, seed) that generates the scene
_REGISTRY: dict[str, tuple[type[Parameters], Callable[[Any, int], Scene]]] = {
    parameters.scene: (parameters, draw)
    for parameters, draw in (
        (ArticulatedParameters, articulated_scene),
        (DistracterParameters, distracter_scene),
        (ProjectilesParameters, projectiles_scene),
        (FaceParameters, face_scene),
        (FishParameters, fish_scene),
        (SkydiversParameters, skydivers_scene),
        (LeavesParameters, leaves_scene),
        (WalkersParameters, walkers_scene),
        (WiresParameters, wires_scene),
    )
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
    source: str | Callable[..., Any], *, seed: int = 0, parameters: Mapping[str, Any] | None = None
) -> Scene:
    """Open a scene by its name or from a function.

    Args:
        source: a name that ``names()`` lists, or a function that returns a ``Scene``, or its
            location, ``path/to/file.py:function`` or ``package.module:function`` (``call_scene``).
        seed: of the scene.
        parameters: of the scene, by name.

    Raises:
        SceneError: an unknown scene or a failing function; the message says which.
    """
    given = dict(parameters or {})
    if callable(source) or (source not in _REGISTRY and names_function(source)):
        return call_scene(source, _whole_seed(str(source), seed), given)
    return make(source, seed, **given)


def _whole_seed(name: str, seed: int) -> int:
    if seed < 0:
        raise SceneError(f"scene {name!r}: seed = {seed!r} must be 0 or more")
    return int(seed)


def _look_up(name: str) -> tuple[type, Callable[[Any, int], Scene]]:
    if name not in _REGISTRY:
        near = difflib.get_close_matches(name, names(), n=1)
        meant = f"did you mean {near[0]!r}?  The" if near else "the"
        raise SceneError(
            f"no scene {name!r}; {meant} scenes are {', '.join(names())}.  You can also "
            "give a folder with an annotated sequence, or a function, file.py:function"
        )
    return _REGISTRY[name]
