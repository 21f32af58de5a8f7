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
from jaxpf.files.writing import LineWriter

HEADERS = ("x,y", "x,y,name")
TRACK_HEADER = "frame,point,x,y,hidden"
_REMEDY = "write x,y or x,y,name in pixels, such as 120,80,nose"


@dataclasses.dataclass(frozen=True, eq=False)
class Points:
    """Start points.

    Attributes:
        names: of the P points; by default their numbers, from 0.
        places: float64 [P, 2], x and y in pixels.
    """

    names: tuple[str, ...]
    places: np.ndarray


def read_points(path: str | os.PathLike[str]) -> Points:
    """Read points from CSV: lines ``x,y`` or ``x,y,name``, with or without such a header.

    Args:
        path: the file; UTF-8, blank lines are skipped.

    Raises:
        InputError: the file cannot be read or a line is invalid; the message names it.
    """
    path = Path(path)
    rows = read_rows(path, "points", "CSV lines x,y,name")
    if rows and ",".join(rows[0][1]).lower() in HEADERS:
        rows = rows[1:]
    if not rows:
        raise InputError(f"'{path}' holds no points; {_REMEDY}, a line each")
    return _points([(f"line {line} of '{path}'", fields) for line, fields in rows])


def parse_points(texts: Sequence[str]) -> Points:
    """Parse points typed as ``"x,y"`` or ``"x,y,name"``."""
    if not texts:
        raise InputError(f"no point was given; {_REMEDY}")
    return _points([(f"point '{text}'", _fields(text)) for text in texts])


def grid_points(mask: ArrayLike, step: float) -> Points:
    """Return the points of a square grid that lie on a mask, row by row.

    Args:
        mask: bool [H, W].
        step: grid spacing, pixels.

    Raises:
        InputError: the mask is not [H, W], the step is below 1, or no point lies on the mask.
    """
    mask = np.asarray(mask)
    if mask.ndim != 2:
        raise InputError(f"the mask has shape {list(mask.shape)}; give one channel, [H, W]")
    if not (math.isfinite(step) and step >= 1):
        raise InputError(f"a grid's step of {step:g} pixels must be a number of at least 1")
    height, width = mask.shape
    x, y = np.meshgrid(np.arange(step / 2, width, step), np.arange(step / 2, height, step))
    on = mask[y.astype(int), x.astype(int)] != 0
    if not on.any():
        raise InputError(f"no point of a grid of {step:g} pixels is on the mask; use a finer one")
    places = np.stack([x[on], y[on]], axis=1)
    return Points(tuple(str(number) for number in range(len(places))), places)


class PointTrackWriter(LineWriter):
    """Appends tracks of points to a file, which after every frame contains whole lines only.

    CSV with the header ``frame,point,x,y,hidden``, in pixels; hidden is 1 or 0.
    """

    header = TRACK_HEADER

    def append(
        self, frame: int, names: Sequence[str], places: ArrayLike, hidden: ArrayLike
    ) -> None:
        """Write the points of one frame.

        Args:
            frame: counting from 0.
            names: [P].
            places: x, y [P, 2]; non-finite ones are omitted.
            hidden: bool [P].

        Raises:
            InputError: the disk is full or the file cannot be written; the file then ends with the
                last complete frame.
        """
        points = zip(names, np.asarray(places), np.asarray(hidden), strict=True)
        self.write_rows(
            [int(frame), name, *(f"{value:.3f}" for value in place), int(is_hidden)]
            for name, place, is_hidden in points
            if np.isfinite(place).all()
        )


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
        if (x, y) in places:
            other = names[places.index((x, y))]
            raise InputError(f"{where} is at the place of '{other}'; move or remove one of them")
        names.append(name)
        places.append((x, y))
    return Points(tuple(names), np.array(places))


def _fields(text: str) -> list[str]:
    return [field.strip() for field in text.split(",")]
