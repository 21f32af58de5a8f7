"""An evaluation's scene: opened once in a process, checked, and told from others."""

import hashlib
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError


def open_scene(scene: Any) -> Any:
    """The scene that a plan means: itself, or what its function returns."""
    return scene() if callable(scene) else scene


def scene_digest(scene: Any) -> str:
    """Tells two scenes apart by their pictures, boxes and patches."""
    digest = hashlib.sha256()
    for array in (scene.frames, scene.boxes, *scene.patches):
        digest.update(f"{array.shape}{array.dtype}".encode())
        for row in array:  # one after another: they need not all be in memory
            digest.update(np.ascontiguousarray(row).data)
    return digest.hexdigest()


def remember_scene(scene: Any, digest: str) -> None:
    """Spare ``run_batch`` in this process from opening a scene that is open already."""
    _last_scene[:] = [(digest, scene)]


def remembered_scene(digest: str) -> Any:
    """The scene of that digest if this process has it open, or None."""
    return next((scene for known, scene in list(_last_scene) if known == digest), None)


#: The scene that this process worked on last, as (digest, scene).
_last_scene: list[tuple[str, Any]] = []


def check_scene(scene: Any) -> None:
    """Refuse a scene in which trackers cannot start.

    Raises:
        InputError: an object without a box in the first frame; no second frame.
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


def object_ids(scene: Any) -> list[int]:
    """The truth's numbers of the objects; from 1 where a scene has none."""
    return [int(number) for number in scene.extras.get("ids", range(1, scene.boxes.shape[1] + 1))]


def start_frame(scene: Any) -> int:
    """The frame of the source in which a scene begins."""
    return int(scene.extras.get("start_frame", 0))
