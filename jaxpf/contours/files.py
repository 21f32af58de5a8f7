"""Files of contours: start contours, and models learned from annotated ones.

Start contours are JSON, written by hand or from a mask::

    {"closed": true, "contours": {"left leaf": [[10, 20], [30, 18], ...], ...}}

Points are control points of a cubic B-spline (or of another ``"degree"``) in continuous pixels,
with pixel (0, 0) the square [0, 1) x [0, 1).  A closed contour's first point is not repeated.
A spline passes near its control points, not through them; the likelihood's ``outline_points``
returns points on the curve.  The optional ``"width"`` makes an open contour the centreline of a
wire of that width in pixels, with two visible edges.

Learned models are JSON, as ``jaxpf contour learn`` writes them and ``jaxpf track --learned`` reads
them.  ``"space"`` holds the arrays of ``jaxpf.shapes.ShapeSpace``; ``"dynamics"``, unless null,
those of ``jaxpf.dynamics.LinearGaussian``; both for one target.  All targets of a run share them.
"""

import dataclasses
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array
from jaxpf.dynamics.gaussian import LinearGaussian
from jaxpf.files.reading import FARTHEST, check_name, read_json
from jaxpf.files.writing import write_text
from jaxpf.shapes.spaces import ShapeSpace, check_contours
from jaxpf.shapes.splines import CUBIC, check_order, crosses_itself, points_on

_KEYS = {"closed", "contours", "degree", "width"}
_EXAMPLE = '{"closed": true, "contours": {"leaf": [[10, 20], [30, 18], [32, 40], [12, 38]]}}'
#: Number of points at which a contour is tested for self-intersection.
_LOOKED_AT = 200


@dataclasses.dataclass(frozen=True, eq=False)
class Contours:
    """Start contours, cubic B-splines by default.

    Attributes:
        names: of the P targets.
        points: float64 ``[P, K, 2]``, control points in pixels.
        closed: whether they are closed curves.
        degree: of the splines.
        width: of a wire with two edges, pixels; None for a contour that is a single edge.
        remarks: warnings about accepted but possibly wrong input.
    """

    names: tuple[str, ...]
    points: np.ndarray
    closed: bool = True
    degree: int = CUBIC
    width: float | None = None
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", check_contours(self.points, self.degree))
        if self.width is not None:
            check_number("width", self.width, above=0)
            if self.closed:
                raise InputError(
                    f"width {self.width:g} works only with open contours; leave it out."
                )

    @property
    def sizes(self) -> np.ndarray:
        """Sizes ``[P]`` in pixels: sides of squares whose diagonal is that of a bounding box.

        It is the box of a contour's control points, which holds the contour.
        """
        return np.linalg.norm(np.ptp(self.points, axis=1), axis=-1) / np.sqrt(2)


class Learned(NamedTuple):
    """A model learned from one target, or from several targets of one kind.

    Attributes:
        space: with one template.
        dynamics: of the same for every target, or None.
    """

    space: ShapeSpace
    dynamics: LinearGaussian | None


def read_contours(path: str | os.PathLike[str]) -> Contours:
    """Read a file of contours.

    A contour that crosses itself is accepted and reported in ``remarks``.

    Raises:
        InputError: the file cannot be read, has a missing or unknown key, too few control points,
            contours of different lengths, or a value that is not a finite number.
    """
    contours = read_json(Path(path), "contours", f"JSON such as {_EXAMPLE}", _contours)
    remarks = []
    for name, control in zip(contours.names, contours.points, strict=True):
        line = points_on(control, _LOOKED_AT, closed=contours.closed, degree=contours.degree)
        if crosses_itself(line, closed=contours.closed):
            remarks.append(f"The contour '{name}' of '{path}' crosses itself; check its points.")
    return dataclasses.replace(contours, remarks=tuple(remarks))


def _contours(content: Mapping[str, Any]) -> Contours:
    if unknown := sorted(content.keys() - _KEYS):
        raise ValueError(f"the key {unknown[0]!r:.60} is unknown")
    closed, given = content["closed"], content["contours"]
    if not isinstance(closed, bool):
        raise ValueError(f'"closed" is {closed!r:.60}, neither true nor false')
    if not given:
        raise ValueError("it has no contours")
    if not _is_place(content.get("width") or 0):
        raise ValueError(f'"width" is {content["width"]!r:.60} instead of a number')
    for name, rows in given.items():
        check_name(name, "a contour")
        for number, row in enumerate(rows if isinstance(rows, list) else [rows]):
            if not (isinstance(row, list) and len(row) == 2 and all(map(_is_place, row))):
                raise ValueError(
                    f"point {number} of contour '{name}' is {row!r:.60} instead of two numbers of "
                    f"at most {FARTHEST:.0f}"
                )
    if len({len(rows) for rows in given.values()}) > 1:
        listed = ", ".join(f"'{name}' {len(rows)}" for name, rows in given.items())
        raise ValueError(f"the contours have different numbers of control points: {listed}"[:400])
    points = np.array([*given.values()], float)
    degree = content.get("degree", CUBIC)
    return Contours(tuple(given), points, closed, degree, content.get("width"))


def _is_place(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= FARTHEST


def contours_text(contours: Contours) -> str:
    """The content of a file that ``read_contours`` reads."""
    lines = [
        f"  {json.dumps(name)}: {json.dumps(np.round(rows, 3).tolist())}"
        for name, rows in zip(contours.names, contours.points, strict=True)
    ]
    head: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
    if contours.width is not None:
        head["width"] = contours.width
    start = json.dumps(head)[:-1]
    return start + ', "contours": {\n' + ",\n".join(lines) + "\n}}\n"


def write_learned(path: str | os.PathLike[str], learned: Learned) -> None:
    """Write a file that ``read_learned`` reads."""

    def first(owner: Any, name: str) -> Any:
        values = getattr(owner, name)
        return None if values is None else np.asarray(values, float)[0].tolist()

    space, moves = learned
    about = {"closed": space.closed, "degree": space.degree}
    about |= {name: first(space, name) for name in ("template", "modes")}
    names = ("transition", "lag", "offset", "noise")
    dynamics = moves and {name: first(moves, name) for name in names}
    write_text(path, json.dumps({"space": about, "dynamics": dynamics}, indent=1) + "\n")


def read_learned(path: str | os.PathLike[str]) -> Learned:
    """Read a file that ``write_learned`` wrote.

    Raises:
        InputError: the file is missing or has other content.
    """
    expected = "a file that `jaxpf contour learn` wrote"
    return read_json(Path(path), "a learned shape space", expected, _learned)


def _learned(content: Mapping[str, Any]) -> Learned:
    about, moves = content["space"], content.get("dynamics")
    degree, count, size = int(about["degree"]), len(about["template"]), len(about["modes"])
    check_order(count, degree)
    space = ShapeSpace(
        template=_numbers(about, "template", (count, 2)),
        modes=_numbers(about, "modes", (size, count, 2)),
        closed=bool(about["closed"]),
        degree=degree,
    )
    if moves is None:
        return Learned(space, None)
    square = (size, size)
    dynamics = LinearGaussian(
        transition=_numbers(moves, "transition", square),
        noise=_numbers(moves, "noise", square),
        lag=None if moves["lag"] is None else _numbers(moves, "lag", square),
        offset=None if moves["offset"] is None else _numbers(moves, "offset", (size,)),
    )
    return Learned(space, dynamics)


def _numbers(about: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> Any:
    """An array with a leading axis of one target."""
    array = np.asarray(about[name], float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite numbers of shape {list(shape)}")
    return as_array(array[None], float)
