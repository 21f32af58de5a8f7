"""Opens scenes, drawn ones and recordings: once per process, identified by a digest."""

import dataclasses
import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import scenes
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.numbers import plain
from jaxpf.evaluation.trackers import own_tracker
from jaxpf.sequences import open_sequence
from scenes import Scene

#: What a plan has: a scene, or a function that opens it.
SceneSource = Scene | Callable[[], Scene]


def load_scene(
    source: Any,
    seed: int = 0,
    ids: Sequence[int] | None = None,
    start_frame: int | None = None,
    num_frames: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> scenes.Scene:
    """Open a scene from any source; picklable, for ``functools.partial`` and worker processes.

    Args:
        source: a name or a function, see ``scenes.open_scene``, or the folder of a recorded
            sequence; write ``./distracter`` for a folder with the name of a drawn scene.
        seed: of drawn scenes.
        ids, start_frame, num_frames: of recordings, see
            ``jaxpf.sequences.sequence.Sequence.scene``.
        parameters: of drawn scenes, by name.

    Raises:
        InputError: the scene cannot be opened.
    """
    if _is_folder(source):
        if parameters:
            raise InputError(
                f"{source} is a recorded sequence and has no parameters, but "
                f"{', '.join(map(repr, parameters))} was given."
            )
        return open_sequence(source).scene(ids, start_frame, num_frames)
    for name, value in {"ids": ids, "start_frame": start_frame, "num_frames": num_frames}.items():
        if value is not None:
            raise InputError(
                Argument(name, repr(value), typed=plain(value)),
                f" chooses from a recorded sequence, but the scene {source!r} is drawn by a "
                "function; set its own parameters instead.",
            )
    try:
        return scenes.open_scene(source, seed=seed, parameters=parameters)
    except scenes.SceneError as error:
        raise InputError(f"{str(error).removesuffix('.')}.") from error


def _is_folder(source: Any) -> bool:
    """Whether ``source`` is or looks like a folder, and is neither a name nor a function."""
    if isinstance(source, Path):
        return True
    if not isinstance(source, str) or source in scenes.names():
        return False
    return Path(source).exists() or ("/" in source and not scenes.names_function(source))


@dataclasses.dataclass(frozen=True)
class Opened:
    """A scene that this process has open.

    Attributes:
        scene: with pictures and truth.
        digest: of its frames, boxes and patches.
    """

    scene: Scene
    digest: str
    _made: dict[Any, tuple[Any, float]] = dataclasses.field(default_factory=dict)

    def made(self, name: str, function: Callable[[Scene], Any]) -> tuple[Any, float]:
        """A user's tracker of this scene, or its tracks, and the seconds that making it took.

        The function is called once.
        """
        if function not in self._made:
            began = time.perf_counter()
            tracker = own_tracker(name, function, self.scene)
            self._made[function] = tracker, time.perf_counter() - began
        return self._made[function]


#: The scene that this process opened last.
_last: list[Opened] = []


def open_scene(source: SceneSource, digest: str | None = None) -> Opened:
    """Open the scene of a plan; with a digest, the one that this process has open.

    Raises:
        InputError: it cannot be opened, or has another digest.
    """
    if digest is not None and _last and _last[0].digest == digest:
        return _last[0]
    scene = source() if callable(source) else source
    made = Opened(scene, _digest_of(scene))
    if digest not in (None, made.digest):
        raise InputError(
            f"scene {scene.name!r} is not the same in every process: its pictures or boxes "
            "differ from those the evaluation began with; give all workers the same files and "
            "the same versions of the libraries that decode them."
        )
    _last[:] = [made]
    return made


def _digest_of(scene: Scene) -> str:
    digest = hashlib.sha256()
    for array in (scene.frames, scene.boxes, *scene.patches):
        digest.update(f"{array.shape}{array.dtype}".encode())
        for row in array:  # one at a time, because lazy frames are not all in memory
            digest.update(np.ascontiguousarray(row).data)
    return digest.hexdigest()


def check_scene(scene: Scene) -> None:
    """Check that trackers can start in a scene.

    Raises:
        InputError: an object has no box in the first frame, or there is no second frame.
    """
    first = np.asarray(scene.boxes[0], float)
    proper = np.isfinite(first).all(axis=1) & (first[:, 2:] > 0).all(axis=1)
    for index in np.flatnonzero(~proper):
        raise InputError(
            f"scene {scene.name!r}: object {object_ids(scene)[index]} has no box in the start "
            f"frame ({start_frame(scene)}); leave it out with `ids`, or choose another start frame."
        )
    if len(scene.frames) < 2:
        raise InputError(
            f"scene {scene.name!r} has {len(scene.frames)} frame(s): trackers start in the first, "
            "so give at least 2."
        )


def object_ids(scene: Scene) -> list[int]:
    """Ground-truth ids of the objects; counted from 1 if the scene has none."""
    return [int(number) for number in scene.extras.get("ids", range(1, scene.boxes.shape[1] + 1))]


def start_frame(scene: Scene) -> int:
    """First frame of a scene in its source."""
    return int(scene.extras.get("start_frame", 0))
