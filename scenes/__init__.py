"""Test-beds for trackers: synthetic scenes, and a reader of annotated real clips.

A scene is frames, truth and reference patches.  ``names()`` lists the synthetic ones,
``make(name, seed)`` draws one, ``read_clip(folder)`` opens a real one.  Nothing here knows of
trackers.
"""

import dataclasses
import operator
from collections.abc import Callable
from typing import Any

from scenes.clips import Clip, read_clip
from scenes.distracter import DistracterParameters, distracter_scene
from scenes.scene import Scene, SceneError

__all__ = [
    "Clip",
    "DistracterParameters",
    "Scene",
    "SceneError",
    "default_parameters",
    "distracter_scene",
    "make",
    "names",
    "read_clip",
]

# name -> its parameters' class, and the function of (parameters, seed) that draws it
_REGISTRY: dict[str, tuple[type, Callable[[Any, int], Scene]]] = {
    "distracter": (DistracterParameters, distracter_scene),
}


def names() -> list[str]:
    """The names that ``make`` knows, sorted."""
    return sorted(_REGISTRY)


def default_parameters(name: str) -> dict[str, Any]:
    """The parameters of a scene and their defaults."""
    parameters_class, _ = _look_up(name)
    return dataclasses.asdict(parameters_class())


def make(name: str, seed: int = 0, **parameters: Any) -> Scene:
    """Draw the scene ``name``; parameters that are not given keep their defaults.

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
    try:
        whole_seed = operator.index(seed)
    except TypeError:
        whole_seed = -1
    if whole_seed < 0:
        raise SceneError(f"scene {name!r}: seed = {seed!r} must be a whole number, 0 or more")
    return draw(parameters_class(**parameters), whole_seed)


def _look_up(name: str) -> tuple[type, Callable[[Any, int], Scene]]:
    if name not in _REGISTRY:
        raise SceneError(f"no scene {name!r}; the scenes are {', '.join(names())}")
    return _REGISTRY[name]
