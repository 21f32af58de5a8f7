"""The registry of targets: one adapter each.

To add a target, write a ``Target`` (``jaxpf.targets.target``) and an ``Adapter``
(``jaxpf.targets.adapter``) as ``ADAPTER`` of ``jaxpf/NAME/adapter.py``, and add NAME to
``_ADAPTERS``.
"""

import importlib
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import InputError, check_known

if TYPE_CHECKING:
    from jaxpf.targets.adapter import Adapter

#: Packages of the targets; a scene gets the first whose ``fits_scene`` is true.
_ADAPTERS = ("points", "parts", "contours", "boxes")
#: Target to track if none is given.
DEFAULT = "boxes"


def adapters() -> "dict[str, Adapter]":
    """All adapters, by target name."""
    return {name: find_adapter(name) for name in _ADAPTERS}


def find_adapter(name: str) -> "Adapter":
    """The adapter of a target.

    Raises:
        InputError: the target is unknown.
    """
    check_known("target ", name, _ADAPTERS)
    return importlib.import_module(f"jaxpf.{name}.adapter").ADAPTER


def adapter_of_scene(scene: Any, name: str | None = None) -> "Adapter":
    """The adapter that fits a scene's ground truth.

    Args:
        scene: see ``scenes.Scene``.
        name: of a target; by default the first that fits.

    Raises:
        InputError: the target is unknown, or the ground truth is of another kind.
    """
    own = next(adapter for adapter in adapters().values() if adapter.fits_scene(scene))
    if name is None:
        return own
    of = find_adapter(name)
    if not of.fits_scene(scene):
        raise InputError(
            f"scene {scene.name!r} has no truth for {of.name}; leave the target out, which takes "
            f"{own.name}."
        )
    return of
