"""Files of points: start points and tracks of points.

(x, y) are continuous pixels, with pixel (0, 0) the square [0, 1) x [0, 1); frames count from 0.
"""

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.files.reading import check_name, parse_number, read_rows

HEADERS = ("x,y", "x,y,name")
#: Header of points that name their frames, as start boxes do.
FRAMES_HEADER = "frame,id,x,y"
_REMEDY = "write x,y or x,y,name in pixels, such as 120,80,nose"


@dataclasses.dataclass(frozen=True, eq=False)
class Points:
    """Start points.

    Attributes:
        names: of the P points; by default their numbers, from 0.
        places: float64 [P, 2], x and y in pixels.
        frames: int [P], from 0; None if the file names no frames.
    """

    names: tuple[str, ...]
    places: np.ndarray
    frames: np.ndarray | None = None

    def at(self, frame: int) -> "Points":
        """The points of one frame; all of them if the file names no frames.

        Raises:
            InputError: there is none in that frame.
        """
        if self.frames is None:
            return self
        rows = np.flatnonzero(self.frames == frame)
        if not len(rows):
            raise InputError(
                f"no point is given for frame {frame}; the first is in frame {self.frames.min()}, "
                f"so choose --start {self.frames.min()}"
            )
        return Points(tuple(self.names[row] for row in rows), self.places[rows])


def read_points(path: str | os.PathLike[str]) -> Points:
    """Read points from CSV: lines ``x,y`` or ``x,y,name``, with or without such a header.

    With the header ``frame,id,x,y`` lines name the frame, from 0, in which a point starts.

    Args:
        path: the file; UTF-8, blank lines are skipped.

    Raises:
        InputError: the file cannot be read or a line is invalid; the message names it.
    """
    path = Path(path)
    rows = read_rows(path, "points", "CSV lines x,y,name")
    header = ",".join(rows[0][1]).lower() if rows else ""
    if header == FRAMES_HEADER:
        return _points_of_frames(path, rows[1:])
    if header in HEADERS:
        rows = rows[1:]
    if not rows:
        raise InputError(f"'{path}' holds no points; {_REMEDY}, a line each")
    return _points([(f"line {line} of '{path}'", fields) for line, fields in rows])


def parse_points(texts: Sequence[str]) -> Points:
    """Parse points typed as ``"x,y"`` or ``"x,y,name"``."""
    if not texts:
        raise InputError(f"no point was given; {_REMEDY}")
    return _points(
        [(f"point '{text}'", [field.strip() for field in text.split(",")]) for text in texts]
    )


def grid_points(mask: ArrayLike, step: float) -> Points:
    """Return the points of a square grid that lie on a mask, row by row.

    Args:
        mask: bool [H, W].
        step: grid spacing, pixels.

    Raises:
        InputError: the mask is not [H, W], the step is below 1, or no point lies on the mask.
    """
    mask = np.asarray(mask)
    if not (math.isfinite(step) and step >= 1):
        raise InputError(f"a grid's step of {step:g} pixels must be a number of at least 1")
    height, width = mask.shape
    x, y = np.meshgrid(np.arange(step / 2, width, step), np.arange(step / 2, height, step))
    on = mask[y.astype(int), x.astype(int)] != 0
    if not on.any():
        raise InputError(f"no point of a grid of {step:g} pixels is on the mask; use a finer one")
    places = np.stack([x[on], y[on]], axis=1)
    return Points(tuple(str(number) for number in range(len(places))), places)


def _points(rows: list[tuple[str, list[str]]]) -> Points:
    names: list[str] = []
    places: list[tuple[float, float]] = []
    for where, fields in rows:
        if len(fields) not in (2, 3):
            raise InputError(f"{where} has {len(fields)} value(s); {_REMEDY}")
        x, y = (parse_number(field, f"{where} holds", _REMEDY) for field in fields[:2])
        name = fields[2] if len(fields) == 3 and fields[2] else str(len(names))
        check_name(name, where)
        if name in names:
            raise InputError(f"{where} repeats the name '{name}'; give every point its own")
        names.append(name)
        places.append((x, y))
    return Points(tuple(names), np.array(places))


def _points_of_frames(path: Path, rows: list[tuple[int, list[str]]]) -> Points:
    remedy = f"write {FRAMES_HEADER}, such as 0,nose,120,80"
    by_frame: dict[int, list[tuple[str, list[str]]]] = {}
    for line, fields in rows:
        where = f"line {line} of '{path}'"
        if len(fields) != 4:
            raise InputError(f"{where} has {len(fields)} value(s); {remedy}")
        frame = parse_number(fields[0], f"{where} holds", remedy)
        if frame < 0 or frame % 1:
            raise InputError(f"{where} has the frame {fields[0]}; frames count from 0")
        by_frame.setdefault(int(frame), []).append((where, [*fields[2:], fields[1]]))
    if not by_frame:
        raise InputError(f"'{path}' holds no points; {remedy}, a line each")
    parts = [_points(given) for given in by_frame.values()]
    return Points(
        names=tuple(name for part in parts for name in part.names),
        places=np.concatenate([part.places for part in parts]),
        frames=np.repeat(list(by_frame), [len(part.names) for part in parts]),
    )
