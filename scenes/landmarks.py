"""Reads landmarks annotated on one body in some frames of a clip.

A clip's folder may contain ``points.csv``: a header ``frame,id,cx,cy`` or
``frame,id,cx,cy,visible`` and one line per frame and point; frames count from 0, (cx, cy) is in
pixels and may be empty for a hidden point (visible 0).
"""

import dataclasses
import math
from pathlib import Path

import numpy as np

from scenes.clips import csv_lines, real_number, whole_number
from scenes.scene import SceneError

_COLUMNS = ["frame", "id", "cx", "cy", "visible"]


@dataclasses.dataclass(frozen=True, eq=False)
class Landmarks:
    """P points in the annotated ones of T frames.

    Attributes:
        ids: ids of the points in the annotation, ascending.
        places: ``[T, P, 2]`` float, x and y in pixels; NaN where not annotated.
        visible: ``[T, P]`` bool; false where there is no line.
        marked: ``[T]`` bool, frames with any line.
    """

    ids: tuple[int, ...]
    places: np.ndarray
    visible: np.ndarray
    marked: np.ndarray


def read_landmarks(folder: str | Path) -> Landmarks:
    """Read ``points.csv`` of a clip.

    Raises:
        SceneError: the file is missing or a line is invalid; the message names it.
    """
    path = Path(folder) / "points.csv"
    if not path.is_file():
        raise SceneError(f"{path} is missing: the clip has no landmarks")
    rows: dict[tuple[int, int], tuple[float, float, bool]] = {}
    for place, cells in csv_lines(path, _COLUMNS, optional=1):
        frame, identity = (whole_number(cells[k], _COLUMNS[k], place) for k in (0, 1))
        x, y = (
            real_number(cells[k], _COLUMNS[k], place)
            if cells[k].strip().lower() not in ("", "nan")
            else math.nan
            for k in (2, 3)
        )
        visible = bool(whole_number(cells[4], _COLUMNS[4], place)) if len(cells) > 4 else True
        if frame < 0:
            raise SceneError(f"{place}: frames count from 0")
        if (frame, identity) in rows:
            raise SceneError(f"{place}: a second line for this point in frame {frame}")
        if visible and not math.isfinite(x + y):
            raise SceneError(f"{place}: a point in view needs cx and cy")
        rows[frame, identity] = x, y, visible
    if not rows:
        raise SceneError(f"{path} holds no landmarks")
    ids = tuple(sorted({identity for _, identity in rows}))
    length = 1 + max(frame for frame, _ in rows)
    places = np.full((length, len(ids), 2), np.nan)
    shown = np.zeros((length, len(ids)), bool)
    for (frame, identity), (x, y, visible) in rows.items():
        column = ids.index(identity)
        places[frame, column] = x, y
        shown[frame, column] = visible
    marked = np.zeros(length, bool)
    marked[[frame for frame, _ in rows]] = True
    return Landmarks(ids, places, shown, marked)
