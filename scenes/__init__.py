"""Test sequences for trackers: synthetic scenes.

A scene is frames, ground truth and reference patches.  ``open_scene(source)`` opens any scene, by
name or from a user's function.  ``names()`` lists the synthetic scenes, ``make(name, seed)``
generates one.  This package does not depend on trackers; ``jaxpf.sequences`` reads recordings.
"""

import dataclasses
import difflib
from collections.abc import Callable, Mapping
from typing import Any

from scenes.articulated import Articulated
from scenes.distracter import Distracter
from scenes.drawn import Drawn
from scenes.face import Face
from scenes.fish import Fish
from scenes.functions import call_scene, cause_of, function_of_text, names_function
from scenes.leaves import Leaves
from scenes.projectiles import Projectiles
from scenes.scene import Scene, SceneError, cut_patch
from scenes.skydivers import Skydivers
from scenes.street import puppet_scene, street_scene
from scenes.walkers import Walkers
from scenes.wires import Wires

__all__ = [
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

#: The synthetic scenes by name.
_DRAWN: Mapping[str, type[Drawn]] = {
    each.name: each
    for each in (
        Articulated,
        Distracter,
        Face,
        Fish,
        Leaves,
        Projectiles,
        Skydivers,
        Walkers,
        Wires,
    )
}


def names() -> list[str]:
    """Return the names of the synthetic scenes, sorted."""
    return sorted(_DRAWN)


def default_parameters(name: str) -> dict[str, Any]:
    """Return the parameters of a scene with their defaults."""
    return dataclasses.asdict(_look_up(name)())


def make(name: str, seed: int = 0, **parameters: Any) -> Scene:
    """Generate the scene ``name``; omitted parameters keep their defaults.

    The same name, seed and parameters give the same scene, bit for bit.
    """
    valid = default_parameters(name)
    unknown = sorted(set(parameters) - set(valid))
    if unknown:
        raise SceneError(
            f"scene {name!r} has no parameter {', '.join(map(repr, unknown))}; "
            f"it has {', '.join(valid)}"
        )
    return _look_up(name)(**parameters).draw(_whole_seed(name, seed))


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
    if callable(source) or (source not in _DRAWN and names_function(source)):
        return call_scene(source, _whole_seed(str(source), seed), given)
    return make(source, seed, **given)


def _whole_seed(name: str, seed: int) -> int:
    if seed < 0:
        raise SceneError(f"scene {name!r}: seed = {seed!r} must be 0 or more")
    return int(seed)


def _look_up(name: str) -> type[Drawn]:
    if name not in _DRAWN:
        near = difflib.get_close_matches(name, names(), n=1)
        meant = f"did you mean {near[0]!r}?  The" if near else "the"
        raise SceneError(
            f"no scene {name!r}; {meant} scenes are {', '.join(names())}.  You can also "
            "give a folder with an annotated sequence, or a function, file.py:function"
        )
    return _DRAWN[name]
