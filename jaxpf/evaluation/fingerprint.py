"""Describes what determines the results, to detect changes without opening the scene."""

import functools
import hashlib
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxpf.evaluation.plan import Plan
from jaxpf.files.writing import report_os_errors
from jaxpf.sequences.layouts import layout_of

if TYPE_CHECKING:
    from scenes import Scene

#: Small text files, compared by content; image and video files are compared by size and mtime.
_TEXTS = {".csv", ".json", ".txt", ".ini", ".py"}


def describe_plan(plan: Plan) -> dict[str, Any]:
    """Everything that determines the results except the number of runs, as JSON values.

    Raises:
        InputError: a file of ``tracks`` cannot be read.
    """
    return {
        "scene": _describe_scene(plan.scene),
        "target": plan.target,
        "methods": _plain(plan.methods),
        "orders": _plain(plan.orders),
        "swaps": list(plan.swaps),
        "grid": _plain(plan.grid),
        "seed": plan.seed,
        "tracks": {name: _describe_file(path) for name, path in plan.tracks.items()},
        "trackers": {name: _describe_function(f) for name, f in plan.trackers.items()},
    }


def fingerprint(scene: "Scene | Callable[[], Scene]") -> str | None:
    """Digest of the files behind a scene; None if there are no files or they are unknown.

    Equal fingerprints mean the same files.  Different ones do not imply different pictures; the
    scene's own digest decides.

    Args:
        scene: of a ``Plan``.  The files are known if it is a ``functools.partial`` with
            ``source=...``, a folder or ``file.py:function``.
    """
    source = scene.keywords.get("source") if isinstance(scene, functools.partial) else None
    if not isinstance(source, str):
        return None
    path = Path(source)
    if not path.is_dir():
        path = Path(source.rpartition(":")[0])
        return _digest([path]) if path.suffix == ".py" and path.is_file() else None
    truth = layout_of(path)[1]
    places = [path] if truth.is_relative_to(path) else [path, truth]
    files = (file for place in places for file in (place, *place.rglob("*")))
    return _digest(sorted(file for file in files if file.is_file()))


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        about = file.stat()
        digest.update(f"{file}\0{about.st_size}\0".encode("utf-8", "surrogateescape"))
        if file.suffix.lower() in _TEXTS:
            digest.update(file.read_bytes())
        else:
            digest.update(f"{about.st_mtime_ns}".encode())
    return digest.hexdigest()


def _describe_scene(scene: Any) -> dict[str, Any]:
    """Describe a scene, or the function that opens it, as JSON values."""
    if isinstance(scene, functools.partial):
        return {
            **_describe_scene(scene.func),
            **({"arguments": [_plain(value) for value in scene.args]} if scene.args else {}),
            **{name: _plain(value) for name, value in scene.keywords.items()},
        }
    if callable(scene):
        name = getattr(scene, "__qualname__", type(scene).__qualname__)
        return {"function": f"{scene.__module__}.{name}"}
    return {"name": scene.name, "parameters": _plain(scene.parameters)}


def _plain(value: object) -> Any:
    """Convert a value to its form after a round trip through JSON."""
    if isinstance(value, Mapping):
        return {str(name): _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return repr(value)


def _describe_file(path: str | os.PathLike[str]) -> dict[str, str]:
    with report_os_errors("read", path):
        content = Path(path).read_bytes()
    return {"file": os.fspath(path), "sha256": hashlib.sha256(content).hexdigest()}


def _describe_function(function: Callable[..., Any]) -> dict[str, Any]:
    """Describe a user's function, with the digest of its source if it has one."""
    digest = getattr(function, "sha256", None)
    return _describe_scene(function) | ({"sha256": digest} if digest else {})
