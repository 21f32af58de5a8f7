"""Opens an evaluation's scene once per process, checks it, and identifies it by a digest."""

import hashlib
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from jaxpf.contract.errors import InputError

if TYPE_CHECKING:
    from scenes import Scene


def open_scene(scene: "Scene | Callable[[], Scene]") -> "Scene":
    """Return the plan's scene, calling it if it is a function.

    Raises:
        InputError: it is no scene.
    """
    opened = scene() if callable(scene) else scene
    if not hasattr(opened, "frames") or not hasattr(opened, "boxes"):
        raise InputError(f"scene is {opened!r:.60}; give what scenes.open_scene returns.")
    return opened


def scene_digest(scene: "Scene") -> str:
    """Digest of a scene's frames, boxes and patches."""
    digest = hashlib.sha256()
    for array in (scene.frames, scene.boxes, *scene.patches):
        digest.update(f"{array.shape}{array.dtype}".encode())
        for row in array:  # one at a time, because lazy frames are not all in memory
            digest.update(np.ascontiguousarray(row).data)
    return digest.hexdigest()


def remember_scene(scene: "Scene", digest: str) -> None:
    """Cache an open scene so that ``same_scene`` in this process does not open it again."""
    _last_scene[:] = [(digest, scene)]


def same_scene(scene: "Scene | Callable[[], Scene]", digest: str) -> "Scene":
    """This process's open scene with a digest; without one, the plan's scene is opened.

    Raises:
        InputError: it cannot be opened, or has another digest.
    """
    for stored, remembered in list(_last_scene):
        if stored == digest:
            return remembered
    opened = open_scene(scene)
    if scene_digest(opened) != digest:
        raise InputError(
            f"scene {opened.name!r} is not the same in every process: its pictures or boxes "
            "differ from those the evaluation began with; give all workers the same files and "
            "the same versions of the libraries that decode them."
        )
    remember_scene(opened, digest)
    return opened


#: The scene that this process used last, as (digest, scene).
_last_scene: "list[tuple[str, Scene]]" = []


def check_scene(scene: "Scene") -> None:
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


def object_ids(scene: "Scene") -> list[int]:
    """Ground-truth ids of the objects; counted from 1 if the scene has none."""
    return [int(number) for number in scene.extras.get("ids", range(1, scene.boxes.shape[1] + 1))]


def start_frame(scene: "Scene") -> int:
    """First frame of a scene in its source."""
    return int(scene.extras.get("start_frame", 0))
