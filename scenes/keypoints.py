"""Reads annotated joints of animals or people in a clip.

A clip's folder may contain ``keypoints.csv``: a header ``frame,id,joint,name,x,y,score`` and one
line per frame, object and joint; frames and joints count from 0, (x, y) is in pixels, and the score
is the confidence of the annotator or the network.
"""

import dataclasses
import math
from pathlib import Path

import numpy as np

from scenes.clips import csv_lines, real_number, whole_number
from scenes.scene import SceneError

_COLUMNS = ["frame", "id", "joint", "name", "x", "y", "score"]


@dataclasses.dataclass(frozen=True, eq=False)
class Keypoints:
    """Joints of P objects in T frames.

    Attributes:
        names: of the J joints.
        ids: ids of the objects in the annotation, ascending.
        places: ``[T, P, J, 2]`` float, x and y in pixels; NaN where there is no line.
        scores: ``[T, P, J]`` float; NaN where there is no line.
    """

    names: tuple[str, ...]
    ids: tuple[int, ...]
    places: np.ndarray
    scores: np.ndarray

    def of(self, identity: int, *names: str) -> np.ndarray:
        """Return the positions ``[T, len(names), 2]`` of an object's joints."""
        if identity not in self.ids:
            known = ", ".join(map(str, self.ids))
            raise SceneError(f"there are no keypoints of object {identity}; the ids are {known}")
        for name in names:
            if name not in self.names:
                known = ", ".join(self.names)
                raise SceneError(f"there is no joint {name!r}; the joints are {known}")
        joints = [self.names.index(name) for name in names]
        return self.places[:, self.ids.index(identity)][:, joints]


def read_keypoints(folder: str | Path) -> Keypoints:
    """Read ``keypoints.csv`` of a clip.

    Raises:
        SceneError: the file is missing or a line is invalid; the message names it.
    """
    path = Path(folder) / "keypoints.csv"
    if not path.is_file():
        raise SceneError(f"{path} is missing: the clip has no keypoints")
    names: dict[int, str] = {}
    rows: dict[tuple[int, int, int], tuple[float, ...]] = {}
    for place, cells in csv_lines(path, _COLUMNS):
        frame, identity, joint = (
            whole_number(cell, name, place) for cell, name in zip(cells[:3], _COLUMNS, strict=False)
        )
        values = tuple(
            real_number(cell, name, place) if cell.strip().lower() not in ("", "nan") else math.nan
            for cell, name in zip(cells[4:], _COLUMNS[4:], strict=True)
        )
        if frame < 0 or joint < 0:
            raise SceneError(f"{place}: frame and joint count from 0")
        if names.setdefault(joint, cells[3]) != cells[3]:
            raise SceneError(f"{place}: joint {joint} was called {names[joint]!r} before")
        if (frame, identity, joint) in rows:
            raise SceneError(f"{place}: a second line for this joint in frame {frame}")
        rows[frame, identity, joint] = values
    if not rows:
        raise SceneError(f"{path} holds no keypoints")
    ids = tuple(sorted({identity for _, identity, _ in rows}))
    joints = sorted(names)
    table = np.full((1 + max(frame for frame, _, _ in rows), len(ids), len(joints), 3), np.nan)
    for (frame, identity, joint), values in rows.items():
        table[frame, ids.index(identity), joints.index(joint)] = values
    return Keypoints(
        names=tuple(names[joint] for joint in joints),
        ids=ids,
        places=table[..., :2],
        scores=table[..., 2],
    )
