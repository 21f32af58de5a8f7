"""Scenes made by users' functions."""

import contextlib
import functools
import importlib
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from scenes.scene import Scene, SceneError

#: Maximum length of a foreign error message that ours repeats.
_LONGEST_CAUSE = 300


def call_scene(function: str | Callable[..., Any], seed: int, parameters: Mapping) -> Scene:
    """Call a user's function that returns a scene.

    Args:
        function: called with ``seed=...`` and the parameters by name; or its location,
            ``path/to/file.py:function`` or ``package.module:function``.  While it loads, it can
            import from the file's folder, or for a module from the current folder.
        seed: a whole number, 0 or more.
        parameters: passed unchanged.

    Raises:
        SceneError: the function cannot be imported or fails; or its result is not a ``Scene``, has
            no frames or objects, or lacks an object in the first frame, where trackers start.
    """
    call = _import_function(function) if isinstance(function, str) else function
    name = getattr(function, "__qualname__", type(function).__name__)
    place = function if isinstance(function, str) else f"{function.__module__}:{name}"
    try:
        scene = call(seed=seed, **parameters)
    except SceneError:
        raise
    except (Exception, SystemExit) as error:
        file = getattr(getattr(call, "__code__", None), "co_filename", "")
        raise SceneError(f"{place} failed with {cause_of(error, file)}") from error
    if not isinstance(scene, Scene):
        raise SceneError(
            f"{place} returned a value of type {type(scene).__name__}, not a scenes.Scene"
        )
    if scene.num_frames == 0 or scene.num_objects == 0:
        raise SceneError(
            f"{place} returned a scene of {scene.num_frames} frames and {scene.num_objects} "
            "objects; it must have at least one of each"
        )
    first = scene.boxes[0]
    for index in np.flatnonzero(~(np.isfinite(first).all(axis=1) & (first[:, 2:] > 0).all(axis=1))):
        raise SceneError(
            f"{place} returned a scene whose object {index + 1} has no box in the first frame, "
            "where trackers start"
        )
    return scene


def function_of_text(text: str, path: str, name: str) -> Callable[..., Any]:
    """Return a function from the text of a Python file, which runs once per process.

    Args:
        text: of the file, which need not exist here.
        path: of the file, for messages, and for its imports of neighbouring files.
        name: of the function.

    Raises:
        SceneError: the text fails to run, or has no such function.
    """
    return _function_in(path, name, functools.partial(_module_of_text, text, path))


def names_function(source: str) -> bool:
    """Whether a text has the form ``file.py:function`` or ``package.module:function``."""
    place, colon, name = source.rpartition(":")
    return bool(colon and place) and name.isidentifier()


def cause_of(error: BaseException, path: str = "") -> str:
    """Describe an error on one line, even if its message has several.

    Args:
        error: of a user's code.
        path: of the user's file; if the error passed through it, the line is included.
    """
    cause = " ".join(f"{type(error).__name__}: {error}".split())
    if len(cause) > _LONGEST_CAUSE:
        cause = f"{cause[:_LONGEST_CAUSE]}..."
    lines = [
        entry.lineno
        for entry in traceback.extract_tb(error.__traceback__)
        if entry.filename == path
    ]
    return f"{cause}, at line {lines[-1]} of {path}" if lines else cause


def _import_function(source: str) -> Callable[..., Any]:
    place, _, name = source.rpartition(":")
    if not place.endswith(".py"):
        return _function_in(place, name, functools.partial(_module, place))
    path = Path(place)
    if not path.is_file():
        raise SceneError(f"{source!r}: there is no file {place}")
    whole = str(path.resolve())
    return _function_in(whole, name, lambda: _module_of_text(path.read_text("utf-8"), whole))


def _function_in(place: str, name: str, load: Callable[[], ModuleType]) -> Callable[..., Any]:
    source = f"{place}:{name}"
    try:
        module = load()
    except (Exception, SystemExit) as error:
        cause = cause_of(error, place)
        raise SceneError(f"{source!r}: {place} cannot be imported ({cause})") from error
    function = getattr(module, name, None)
    if not callable(function):
        raise SceneError(f"{source!r}: {place} has no function {name!r}")
    return function


@functools.cache
def _module_of_text(text: str, path: str) -> ModuleType:
    # By full path, so that two files named scene.py do not replace each other.
    name = f"user_file:{path}"
    module = ModuleType(name)
    module.__file__ = path
    sys.modules[name] = module  # dataclasses look up their module there
    try:
        with _importable(Path(path).parent):
            exec(compile(text, path, "exec"), module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _module(name: str) -> ModuleType:
    with _importable(Path.cwd()):
        return importlib.import_module(name)


@contextlib.contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Make the modules of a folder importable, as when Python runs a script there."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
