"""The registry of targets.

To add a target, write a ``Target`` (``jaxpf.targets.target``) as ``NAME`` in capitals of
``jaxpf/NAME/target.py``, and add NAME to ``_TARGETS``.
"""

import importlib
from typing import TYPE_CHECKING

from jaxpf.contract.errors import InputError, check_known

if TYPE_CHECKING:
    from jaxpf.targets.target import Target
    from scenes import Scene

#: Packages of the targets; a scene gets the first whose ``fits_scene`` is true.
_TARGETS = ("points", "parts", "contours", "boxes")
#: Target to track if none is given.
DEFAULT = "boxes"


def all_targets() -> "dict[str, Target]":
    """All targets, by name."""
    return {name: find_target(name) for name in _TARGETS}


def find_target(name: str) -> "Target":
    """The target of a name.

    Raises:
        InputError: the target is unknown.
    """
    check_known("target ", name, _TARGETS)
    return getattr(importlib.import_module(f"jaxpf.{name}.target"), name.upper())


def target_of_scene(scene: "Scene", name: str | None = None) -> "Target":
    """The target that fits a scene's ground truth.

    Args:
        scene: see ``scenes.Scene``.
        name: of a target; by default the first that fits.

    Raises:
        InputError: the target is unknown, or the ground truth is of another kind.
    """
    own = next(target for target in all_targets().values() if target.fits_scene(scene))
    if name is None:
        return own
    of = find_target(name)
    if not of.fits_scene(scene):
        raise InputError(
            f"scene {scene.name!r} has no truth for {of.name}; leave the "
            f"target out, and {own.name} are tracked."
        )
    return of
