"""What a substate means: one module per target.

To add a target, write a ``Target`` and enter it in ``_TARGETS``.
"""

import importlib
from typing import TYPE_CHECKING, Any

from jaxpf.errors import InputError

if TYPE_CHECKING:
    from jaxpf.targets.target import Target

#: Name -> where its ``Target`` stands; the first that fits a scene's truth is taken.
_TARGETS = {
    "points": "jaxpf.targets.points:POINTS",
    "parts": "jaxpf.targets.parts:PARTS",
    "contours": "jaxpf.targets.contours:CONTOURS",
    "boxes": "jaxpf.targets.boxes:BOXES",
}
#: What is tracked where nothing tells.
DEFAULT = "boxes"


def targets() -> "dict[str, Target]":
    """All targets, by name."""
    return {name: find_target(name) for name in _TARGETS}


def find_target(name: str) -> "Target":
    """The target of that name.

    Raises:
        InputError: there is none.
    """
    if name not in _TARGETS:
        raise InputError(f"target {name!r} is unknown; choose one of {', '.join(_TARGETS)}.")
    module, _, attribute = _TARGETS[name].partition(":")
    return getattr(importlib.import_module(module), attribute)


def target_of_scene(scene: Any) -> "Target":
    """The target that a scene's truth is about."""
    return next(one for one in targets().values() if one.fits_scene(scene))
