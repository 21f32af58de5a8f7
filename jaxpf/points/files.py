"""Files of points: start points and tracks of points.

(x, y) are continuous pixels, with pixel (0, 0) the square [0, 1) x [0, 1); frames count from 0.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
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
    rows = read_rows(Path(path), "points", "CSV lines x,y,name")
    header = ",".join(rows[0][1]).lower() if rows else ""
    if header in (*HEADERS, FRAMES_HEADER):
        rows = rows[1:]
    if not rows:
        raise InputError(f"'{path}' holds no points; {_REMEDY}, a line each")
    lines = [(f"line {line} of '{path}'", fields) for line, fields in rows]
    return _points(lines, framed=header == FRAMES_HEADER)


def parse_points(texts: Sequence[str]) -> Points:
    """Parse points typed as ``"x,y"`` or ``"x,y,name"``, at least one."""
    return _points(
        [(f"point '{text}'", [field.strip() for field in text.split(",")]) for text in texts]
    )


def _points(rows: list[tuple[str, list[str]]], framed: bool = False) -> Points:
    """The points of lines; ``framed`` ones begin with the frame and the name."""
    remedy = f"write {FRAMES_HEADER}, such as 0,nose,120,80" if framed else _REMEDY
    names: list[tuple[int, str]] = []
    places = []
    for where, fields in rows:
        if len(fields) not in ((4,) if framed else (2, 3)):
            raise InputError(f"{where} has {len(fields)} value(s); {remedy}")
        at, name, *place = fields if framed else ("0", "".join(fields[2:]), *fields[:2])
        frame = int(parse_number(at, f"{where}: frame is", remedy, least=0, whole=True))
        name = name or str(sum(frame == other for other, _ in names))
        check_name(name, where)
        if (frame, name) in names:
            raise InputError(f"{where} repeats the name '{name}'; give every point its own")
        names.append((frame, name))
        places.append([parse_number(field, f"{where} holds", remedy) for field in place])
    frames = np.array([frame for frame, _ in names]) if framed else None
    return Points(tuple(name for _, name in names), np.array(places), frames)


def grid_points(mask: ArrayLike, step: float) -> Points:
    """Return the points of a square grid that lie on a mask, row by row.

    Args:
        mask: bool [H, W].
        step: grid spacing, pixels.

    Raises:
        InputError: the step is below 1, or no point lies on the mask.
    """
    mask = np.asarray(mask)
    check_number("step", step, least=1)
    height, width = mask.shape
    x, y = np.meshgrid(np.arange(step / 2, width, step), np.arange(step / 2, height, step))
    on = mask[y.astype(int), x.astype(int)] != 0
    if not on.any():
        raise InputError(f"no point of a grid of {step:g} pixels is on the mask; use a finer one")
    places = np.stack([x[on], y[on]], axis=1)
    return Points(tuple(str(number) for number in range(len(places))), places)
