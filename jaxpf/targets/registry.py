"""The kinds of target: those of this library, those of entry points, and those registered."""

import functools
import importlib
from importlib.metadata import entry_points

from jaxpf.contract.errors import InputError, check_known
from jaxpf.targets.target import Target
from scenes import Scene

#: Target to track if none is given.
DEFAULT = "boxes"
#: A scene gets the first kind whose truth it has, those of users before those of this library.
_OWN = ("points", "parts", "contours", "boxes")
_REGISTERED: dict[str, Target] = {}


def register(target: Target) -> None:
    """Add a kind of target to the command line and to evaluations.

    A package does so by an entry point of the group ``jaxpf.targets``, ``NAME = "module:TARGET"``.
    """
    _REGISTERED[target.name] = target


@functools.cache
def _installed() -> dict[str, Target]:
    return {entry.name: entry.load() for entry in entry_points(group="jaxpf.targets")}


def all_targets() -> dict[str, Target]:
    """All kinds of target, by name."""
    own = {n: getattr(importlib.import_module(f"jaxpf.{n}.target"), n.upper()) for n in _OWN}
    return _REGISTERED | _installed() | own


def find_target(name: str) -> Target:
    """The target of a name.

    Raises:
        InputError: the target is unknown.
    """
    check_known("target ", name, all_targets())
    return all_targets()[name]


def target_of_scene(scene: Scene, name: str | None = None) -> Target:
    """The target that fits a scene's ground truth.

    Args:
        scene: see ``scenes.Scene``.
        name: of a target; by default the first that fits.

    Raises:
        InputError: the target is unknown, or the ground truth is of another kind.
    """
    own = next(each for each in all_targets().values() if each.scene_shapes(scene) is not None)
    if name is None:
        return own
    of = find_target(name)
    if of.scene_shapes(scene) is None:
        raise InputError(
            f"scene {scene.name!r} has no truth for {of.name}; leave the "
            f"target out, and {own.name} are tracked."
        )
    return of
