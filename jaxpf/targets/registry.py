"""How a program reads, writes, draws and asks for a target: one adapter per target.

To add a target, write a ``Target`` (what it is, ``jaxpf.targets.target``) and an ``Adapter``
(``jaxpf.targets.adapter``) as ``ADAPTER`` of ``jaxpf/NAME/adapter.py``, and enter NAME
in ``_ADAPTERS``.
"""

import importlib
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import InputError, check_known

if TYPE_CHECKING:
    from jaxpf.targets.adapter import Adapter

#: Folders of the targets; the first that fits a scene's truth is taken.
_ADAPTERS = ("points", "parts", "contours", "boxes")
#: What is tracked where nothing tells.
DEFAULT = "boxes"


def adapters() -> "dict[str, Adapter]":
    """All adapters, by the names of their targets."""
    return {name: find_adapter(name) for name in _ADAPTERS}


def find_adapter(name: str) -> "Adapter":
    """The adapter of the target of that name.

    Raises:
        InputError: there is none.
    """
    check_known("target ", name, _ADAPTERS)
    return importlib.import_module(f"jaxpf.{name}.adapter").ADAPTER


def adapter_of_scene(scene: Any, name: str | None = None) -> "Adapter":
    """The adapter of the target that a scene's truth is about.

    Args:
        scene: see ``scenes.Scene``.
        name: of the target, where that is asked for.

    Raises:
        InputError: no target has that name, or the truth is of another kind.
    """
    own = next(one for one in adapters().values() if one.fits_scene(scene))
    if name is None:
        return own
    of = find_adapter(name)
    if not of.fits_scene(scene):
        raise InputError(
            f"scene {scene.name!r} has no truth for {of.name}; leave the target out, which takes "
            f"{own.name}."
        )
    return of
