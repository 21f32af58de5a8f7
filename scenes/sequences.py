"""Opens every kind of scene: a registered name, a folder with a real sequence, or a function."""

import contextlib
import functools
import importlib
import inspect
import operator
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from scenes.benchmark_clips import read_mot, read_otb
from scenes.clips import Clip, cut_patch, read_clip
from scenes.frames import LazyFrames
from scenes.scene import Scene, SceneError

_FORMATS = (
    "meta.json and gt.csv, or seqinfo.ini, gt/gt.txt and img1/ (MOTChallenge), or "
    "groundtruth_rect.txt and img/ (OTB)"
)

#: Maximum size in bytes of pictures kept in memory; longer sequences are read on demand.
MOST_KEPT = 512 * 2**20

#: Maximum length of a foreign error message that ours repeats.
_LONGEST_CAUSE = 300


def open_folder(folder: str | Path) -> Clip:
    """Open an annotated sequence; its files determine which of the three formats it has.

    * ``meta.json`` or ``gt.csv``: see ``read_clip``.
    * ``seqinfo.ini``, ``gt/`` or ``img1/``: a MOTChallenge sequence, see ``read_mot``.
    * ``groundtruth_rect*.txt`` or ``img/``: an OTB sequence, see ``read_otb``.

    Raises:
        SceneError: no such folder, an unknown format, or an error of the reader.
    """
    folder = Path(folder)
    if not folder.is_dir():
        kind = "is a file, not a folder" if folder.exists() else "does not exist"
        raise SceneError(f"{folder} {kind}; give the folder of a sequence")
    read = _reader(folder)
    if read is None:
        raise SceneError(f"{folder} is no sequence in a known format; it must hold {_FORMATS}")
    return read(folder)


def sequences_in(folder: str | Path) -> list[Path]:
    """Return the sequences in a folder, by name; none if the folder itself is a sequence."""
    folder = Path(folder)
    if not folder.is_dir() or _reader(folder) is not None:
        return []
    return [each for each in sorted(folder.iterdir()) if each.is_dir() and _reader(each)]


def _reader(folder: Path) -> Callable[[Path], Clip] | None:
    """Return the reader for a folder's format, or None if the format is unknown."""
    if any((folder / name).exists() for name in ("meta.json", "gt.csv")):
        return read_clip
    if any((folder / name).exists() for name in ("seqinfo.ini", "gt", "img1")):
        return read_mot
    if (folder / "img").is_dir() or any(folder.glob("groundtruth_rect*.txt")):
        return read_otb
    return None


def start_scene(
    clip: Clip,
    ids: Sequence[int] | None = None,
    start_frame: int | None = None,
    num_frames: int | None = None,
) -> Scene:
    """Return the part of a clip that starts where all its objects are in view.

    Its frames are an array if they take at most ``MOST_KEPT`` bytes, otherwise ``LazyFrames``,
    which are decoded at every pass.

    A box counts as in view if it covers at least one pixel of the picture.  Boxes that extend
    beyond the picture stay whole, but their reference patch is the part inside, so ``Scene.sizes``
    is then smaller than ``boxes[0, :, 2:]``, the size a tracker should start with.

    Args:
        clip: an annotated sequence.
        ids: the objects, in this order; by default all objects in view in the start frame or, if
            none is given, in the first frame with any object.
        start_frame: counting from 0; by default the first frame with all ``ids`` in view.
        num_frames: number of frames from the start; by default all.

    Returns:
        A scene that begins with the start frame, with patches cut there.  ``extras`` holds
        ``ids [P]``, ``start_frame``, ``source`` (the folder) and ``occlusion [T, P]`` (-1 if
        unknown).

    Raises:
        SceneError: unknown or repeated ids, objects that are not in view in the start frame (the
            message gives the first frame in which they are), or frames that the clip lacks.
    """
    in_view = _in_view(clip)
    columns = None if ids is None else _columns(clip, ids)
    if start_frame is None:
        start = _first_common_frame(clip, in_view, columns)
    else:
        start = _whole(start_frame, "start_frame")
        if not 0 <= start < clip.num_frames:
            raise SceneError(
                f"clip {clip.name!r} has the frames 0 to {clip.num_frames - 1}, not {start}"
            )
    if columns is None:
        columns = np.flatnonzero(in_view[start]).tolist()
        if not columns:
            first = int(np.argmax(in_view.any(axis=1)))
            raise SceneError(
                f"clip {clip.name!r} has no object in frame {start}; the first is in frame {first}"
            )
    absent = [column for column in columns if not in_view[start, column]]
    if absent:
        raise SceneError(
            f"clip {clip.name!r}: in its start frame {start} "
            + "; ".join(_absence(clip, in_view, column) for column in absent)
        )
    rest = clip.num_frames - start
    length = rest if num_frames is None else _whole(num_frames, "num_frames")
    if not 1 <= length <= rest:
        raise SceneError(
            f"clip {clip.name!r} has {rest} frames from frame {start} on, so num_frames must lie "
            f"in 1..{rest}, not {length}"
        )
    stop = start + length
    lazy = LazyFrames(clip, range(start, stop))
    frames = np.asarray(lazy) if lazy.nbytes <= MOST_KEPT else lazy
    first = frames[0]
    chosen = tuple(clip.ids[column] for column in columns)
    return Scene(
        name=clip.name,
        frames=frames,
        boxes=clip.boxes[start:stop, columns],
        patches=[cut_patch(first, clip.boxes[start, column]) for column in columns],
        fps=clip.fps,
        parameters={
            "source": str(clip.folder),
            "ids": chosen,
            "start_frame": start,
            "num_frames": length,
        },
        extras={
            "ids": np.array(chosen, dtype=int),
            "start_frame": start,
            "source": str(clip.folder),
            "occlusion": clip.occlusion[start:stop, columns],
        },
    )


def call_scene(function: str | Callable[..., Any], seed: int, parameters: Mapping) -> Scene:
    """Call a user's function that returns a scene.

    Args:
        function: called with ``seed=...`` and the parameters by name; or its location,
            ``path/to/file.py:function`` or ``package.module:function``.  While it loads, it can
            import from the file's folder, or for a module from the current folder.
        seed: a whole number, 0 or more.
        parameters: passed unchanged.

    Raises:
        SceneError: the function cannot be imported, takes other arguments or fails; or its result
            is not a ``Scene``, has no frames or objects, or lacks an object in the first frame,
            where trackers start.
    """
    place = function if isinstance(function, str) else _name_of(function)
    call = _import_function(function) if isinstance(function, str) else function
    shown = ", ".join(f"{name}=..." for name in ("seed", *parameters))
    try:
        inspect.signature(call).bind(seed=seed, **parameters)
    except TypeError as error:
        raise SceneError(f"{place} cannot be called with ({shown}): {error}") from None
    except ValueError:
        pass  # some built-in functions have no signature; the call will show
    try:
        scene = call(seed=seed, **parameters)
    except SceneError:
        raise
    except (Exception, SystemExit) as error:
        raise SceneError(f"{place} failed with {cause_of(error, _file_of(call))}") from error
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
    return _function_in(f"{path}:{name}", path, lambda: _module_of_text(text, path), name)


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


# Helpers


def _in_view(clip: Clip) -> np.ndarray:
    """``[T, P]`` bool: whether a box covers at least one pixel, rounded as in ``cut_patch``."""
    low, extent = clip.boxes[..., :2], clip.boxes[..., 2:]
    size = np.array([clip.width, clip.height])
    start, end = np.clip(np.rint(low), 0, size), np.clip(np.rint(low + extent), 0, size)
    return np.all(end > start, axis=-1)  # false where NaN


def _columns(clip: Clip, ids: Sequence[int]) -> list[int]:
    wanted = [_whole(number, "ids") for number in ids]
    if not wanted:
        raise SceneError(f"no ids were asked for; the ids of clip {clip.name!r} are {_ids(clip)}")
    for index, number in enumerate(wanted):
        if number not in clip.ids:
            raise SceneError(f"clip {clip.name!r} has no object {number}; its ids are {_ids(clip)}")
        if number in wanted[:index]:
            raise SceneError(f"object {number} is asked for twice; name each id once")
    return [clip.ids.index(number) for number in wanted]


def _ids(clip: Clip) -> str:
    return ", ".join(map(str, clip.ids))


def _first_common_frame(clip: Clip, in_view: np.ndarray, columns: list[int] | None) -> int:
    """The first frame with all ``columns`` in view; if ``columns`` is None, with any object."""
    together = in_view.any(axis=1) if columns is None else in_view[:, columns].all(axis=1)
    if together.any():
        return int(np.argmax(together))
    if columns is None:
        raise SceneError(f"clip {clip.name!r}: no object's box ever meets the picture")
    spans = []
    for column in columns:
        seen = np.flatnonzero(in_view[:, column])
        span = f"from {seen[0]} to {seen[-1]}" if len(seen) else "in none"
        spans.append(f"object {clip.ids[column]} is seen {span}")
    raise SceneError(
        f"clip {clip.name!r}: the objects {', '.join(str(clip.ids[c]) for c in columns)} are "
        f"together in no frame ({'; '.join(spans)}); choose others with ids"
    )


def _absence(clip: Clip, in_view: np.ndarray, column: int) -> str:
    seen = np.flatnonzero(in_view[:, column])
    first = f"it first appears in frame {seen[0]}" if len(seen) else "it never appears"
    return f"object {clip.ids[column]} is absent ({first})"


def _whole(value: Any, name: str) -> int:
    try:
        return operator.index(value)
    except TypeError:
        raise SceneError(f"{name} = {value!r} must be a whole number") from None


def _name_of(function: Callable) -> str:
    name = getattr(function, "__qualname__", type(function).__name__)
    return f"{getattr(function, '__module__', '')}:{name}"


def _file_of(function: Callable) -> str:
    return getattr(getattr(function, "__code__", None), "co_filename", "")


def _import_function(source: str) -> Callable[..., Any]:
    place, _, name = source.rpartition(":")
    is_file = place.endswith(".py")
    if is_file and not Path(place).is_file():
        raise SceneError(f"{source!r}: there is no file {place}")
    load = (lambda: _load_file(Path(place))) if is_file else (lambda: _load_module(place))
    return _function_in(source, place, load, name)


def _function_in(
    source: str, place: str, load: Callable[[], ModuleType], name: str
) -> Callable[..., Any]:
    try:
        module = load()
    except (Exception, SystemExit) as error:
        where = str(Path(place).resolve()) if place.endswith(".py") else ""
        raise SceneError(
            f"{source!r}: {place} cannot be imported ({cause_of(error, where)})"
        ) from error
    function = getattr(module, name, None)
    if not callable(function):
        state = "has no function" if function is None else "holds something that is no function,"
        defined = sorted(
            key
            for key, value in vars(module).items()
            if inspect.isfunction(value)
            and value.__module__ == module.__name__
            and not key.startswith("_")
        )
        listed = f"; it defines {', '.join(defined)}" if defined else ""
        raise SceneError(f"{source!r}: {place} {state} {name!r}{listed}")
    return function


def _load_file(path: Path) -> ModuleType:
    return _module_of_text(path.read_text(encoding="utf-8"), str(path.resolve()))


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


def _load_module(name: str) -> ModuleType:
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
