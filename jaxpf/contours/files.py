"""Files of contours: start contours and tracks.

JSON, written by hand or from a mask::

    {"closed": true, "contours": {"left leaf": [[10, 20], [30, 18], ...], ...}}

Points are control points of a cubic B-spline (or of another ``"degree"``) in continuous pixels,
with pixel (0, 0) the square [0, 1) x [0, 1).  A closed contour's first point is not repeated.
A spline passes near its control points, not through them; the likelihood's ``outline_points``
returns points on the curve.  The optional ``"width"`` makes an open contour the centreline of a
wire of that width in pixels, with two visible edges.
"""

import dataclasses
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contours.data import Contours
from jaxpf.contract.errors import InputError
from jaxpf.files.reading import check_name, read_text
from jaxpf.files.writing import LineWriter, write_text
from jaxpf.shapes.splines import CUBIC, crosses_itself, points_on

TRACK_HEADER = "frame,id,k,x,y,kind"
_KEYS = {"closed", "contours", "degree", "width"}
_EXAMPLE = '{"closed": true, "contours": {"leaf": [[10, 20], [30, 18], [32, 40], [12, 38]]}}'
#: Number of points at which a contour is tested for self-intersection.
_LOOKED_AT = 200
#: Largest coordinate, pixels.
_FARTHEST = 1e9


def read_contours(path: str | os.PathLike[str]) -> Contours:
    """Read a file of contours.

    A contour that crosses itself is accepted and reported in ``remarks``.

    Raises:
        InputError: no such file, invalid JSON, a missing or unknown key, too few control points,
            contours of different lengths, or a value that is not a finite number.
    """
    path = Path(path)
    content = _content(path)
    closed = content.get("closed")
    if not isinstance(closed, bool):
        said = f'"closed" is {json.dumps(closed)}' if "closed" in content else '"closed" is missing'
        raise InputError(f"'{path}': {said}; give true or false.")
    degree, width = content.get("degree", CUBIC), content.get("width")
    given = content.get("contours")
    if not isinstance(given, dict) or not given:
        raise InputError(f"'{path}' holds no contours; write them as in {_EXAMPLE}.")
    for name in given:
        check_name(name, f"a contour of '{path}'")
    points = [_points(path, name, rows) for name, rows in given.items()]
    lengths = {name: len(rows) for name, rows in zip(given, points, strict=True)}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"'{name}' {count}" for name, count in lengths.items())
        raise InputError(
            f"'{path}': the contours have different numbers of control points: {listed}; give all "
            "the same number."
        )
    try:
        contours = Contours(tuple(given), np.array(points), closed, degree, width)
    except InputError as error:
        raise InputError(f"'{path}': {error}") from None
    remarks = []
    for name, control in zip(given, points, strict=True):
        line = points_on(control, _LOOKED_AT, closed=closed, degree=degree)
        if crosses_itself(line, closed=closed):
            remarks.append(f"The contour '{name}' of '{path}' crosses itself; check its points.")
    return dataclasses.replace(contours, remarks=tuple(remarks))


def write_contours(path: str | os.PathLike[str], contours: Contours) -> None:
    """Write a file that ``read_contours`` reads."""
    write_text(path, contours_text(contours))


def contours_text(contours: Contours) -> str:
    """The content of the file of ``write_contours``."""
    lines = [
        f"  {json.dumps(name)}: {json.dumps(np.round(rows, 3).tolist())}"
        for name, rows in zip(contours.names, np.asarray(contours.points, float), strict=True)
    ]
    head: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
    if contours.width is not None:
        head["width"] = contours.width
    start = json.dumps(head)[:-1]
    return start + ', "contours": {\n' + ",\n".join(lines) + "\n}}\n"


class ContourTrackWriter(LineWriter):
    """Appends tracks of contours to a file, which after every frame contains whole lines only.

    CSV with the header ``frame,id,k,x,y,kind``.  Every contour has points of kind
    ``control``, usable as start contours, and of kind ``outline``, for drawing.
    """

    header = TRACK_HEADER

    def append(
        self,
        frame: int,
        names: Sequence[object] | np.ndarray,
        control: np.ndarray,
        outlines: np.ndarray,
    ) -> None:
        """Write the contours of one frame.

        Args:
            frame: counting from 0.
            names: ``[P]``.
            control: control points ``[P, K, 2]``, pixels; K is 0 if there are none.
            outlines: ``[P, V, 2]``; a target with a non-finite point is omitted.

        Raises:
            InputError: the disk is full or the file cannot be written.
        """
        self.write_rows(
            [int(frame), name, number, f"{x:.3f}", f"{y:.3f}", kind]
            for target, name in enumerate(names)
            if np.isfinite(outlines[target]).all()
            for kind, points in (("control", control), ("outline", outlines))
            for number, (x, y) in enumerate(points[target])
        )


def _content(path: Path) -> dict[str, Any]:
    text = read_text(path, "contours", _EXAMPLE)
    try:
        content = json.loads(text, object_pairs_hook=lambda pairs: _unique(path, pairs))
    except (ValueError, RecursionError) as error:
        raise InputError(f"'{path}' is no JSON ({error}); write it as {_EXAMPLE}.") from None
    if not isinstance(content, dict):
        kind = "list" if isinstance(content, list) else "single value"
        raise InputError(f"'{path}' holds a {kind}; write it as {_EXAMPLE}.")
    unknown = sorted(set(content) - _KEYS)
    if unknown:
        raise InputError(
            f"'{path}' has the unknown key {unknown[0]!r}; its keys are {', '.join(sorted(_KEYS))}."
        )
    return content


def _unique(path: Path, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Build a JSON object; refuse duplicate names, of which JSON would silently drop the first."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"'{path}' holds '{name}' twice; give each a name of its own.")
    return dict(pairs)


def _points(path: Path, name: str, rows: object) -> np.ndarray:
    if not isinstance(rows, list):
        raise InputError(f"'{path}': contour '{name}' is not a list of points [x, y].")
    for number, row in enumerate(rows):
        if not (isinstance(row, list) and len(row) == 2 and all(_is_number(v) for v in row)):
            raise InputError(
                f"'{path}': point {number} of contour '{name}' is {json.dumps(row)[:60]}; give two "
                f"numbers of at most {_FARTHEST:.0f}, [x, y]."
            )
    return np.array(rows, float)


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= _FARTHEST
