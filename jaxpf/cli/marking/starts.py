"""Start files as shapes on the page, and back.

A shape is a dictionary as the page keeps it: ``kind``, ``name``, ``frame``, and for boxes ``x, y,
w, h``; for points ``x, y``; for parts the ends of a limb ``x1, y1, x2, y2``, its ``width`` and
``parent``; for contours ``points`` on the curve, ``closed`` and the ``width`` of a wire.
"""

import itertools
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.boxes.tracks import parse_box, read_boxes
from jaxpf.contours.files import Contours, contours_text, read_contours
from jaxpf.contract.errors import InputError
from jaxpf.files.reading import read_rows
from jaxpf.files.writing import atomic_write, csv_text
from jaxpf.parts.files import HEADER, read_parts
from jaxpf.points.files import FRAMES_HEADER, parse_points, read_points
from jaxpf.shapes.splines import CUBIC, fit_spline, points_on

Shapes = list[dict[str, Any]]
#: Suffix of each kind's start file, whose flag has the name of the kind.
SUFFIXES = {"boxes": ".csv", "points": ".csv", "parts": ".csv", "contours": ".json"}
#: Columns of each kind's table.
_HEADERS = {"boxes": "frame,id,x,y,w,h", "points": FRAMES_HEADER, "parts": HEADER}
#: Number of control points of closed and of open contours.
_CONTROL = {True: 16, False: 12}


def write_start(path: Path, kind: str, shapes: Shapes) -> None:
    """Write the start file of one kind of target, if the same shapes can be read from it again.

    Raises:
        InputError: the file would be refused, or lack a shape; or parts or contours lie in several
            frames.  An earlier file stays as it was.
    """
    frames = sorted({shape["frame"] for shape in shapes})
    if kind in ("parts", "contours") and len(frames) > 1:
        raise InputError(
            f"{kind} were drawn in frames {frames[0]} and {frames[1]}; draw all in one frame; to "
            "start again in a later one, use another --output."
        )
    shapes = sorted(shapes, key=lambda shape: shape["frame"])
    places = [_place(shape) for shape in shapes]
    with atomic_write(path) as file:
        file.write(_text(kind, shapes))
        file.flush()
        try:
            names = [shape["name"] for shape in read_start(Path(file.name), kind, 0)]
        except InputError as error:  # the page has no lines, so it names the shape of the line
            line = re.compile(rf"line (\d+) of '{re.escape(file.name)}'")
            sentence = line.sub(lambda found: places[int(found[1]) - 2], f"{error}")
            raise InputError(sentence) from None
        for shape, place, name in itertools.zip_longest(shapes, places, names):
            if shape["name"] != name:
                raise InputError(
                    f"{place} would not be read again; give it a plain name, and a width and "
                    "height above 0"
                )


def save_start(path: Path, kind: str, shapes: Shapes) -> None:
    """Write the shapes; if some cannot be read again, only the others, and raise.

    Raises:
        InputError: see ``write_start``.  Nothing that was in the file is lost.
    """
    try:
        write_start(path, kind, shapes)
    except InputError:
        sound = [shape for shape in shapes if _is_sound(path, kind, shape)]
        if 0 < len(sound) < len(shapes):
            drawn = {_place(shape) for shape in sound}
            before = read_start(path, kind, sound[0]["frame"]) if path.is_file() else []
            write_start(path, kind, sound + [one for one in before if _place(one) not in drawn])
        raise


def _is_sound(path: Path, kind: str, shape: dict[str, Any]) -> bool:
    """Whether a shape can be stored by itself."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            write_start(Path(folder) / path.name, kind, [shape | {"parent": ""}])
        except InputError:
            return False
    return True


def _place(shape: dict[str, Any]) -> str:
    return f"'{shape['name']}' in frame {shape['frame']}"


def read_start(path: Path, kind: str, frame: int) -> Shapes:
    """The shapes of a start file; ``frame`` is that of files that do not name frames."""
    return [{"kind": kind, "frame": frame, **shape} for shape in _READERS[kind](path)]


def check_start(path: Path, kind: str) -> None:
    """Refuse to replace a file that holds anything else than start shapes as on the page."""
    if not path.exists():
        return
    if kind == "contours":
        contours = read_contours(path)
        number = contours.points.shape[1]
        is_start = contours.degree == CUBIC and number == _CONTROL[contours.closed]
    else:
        (_, header), *rows = read_rows(path, kind, _HEADERS[kind]) or [(1, [])]
        is_whole = ",".join(header) == _HEADERS[kind]
        is_start = is_whole and len(rows) == len(read_start(path, kind, 0))
    if not is_start:
        raise InputError(
            f"'{path}' is no start file of {kind} as written by the page; it stays as it is, so "
            "choose another --output."
        )


def typed_start(table: Mapping[str, Any], frame: int) -> Shapes:
    """The shapes of --box and --point in a run's configuration."""
    boxes = [(str(n), parse_box(text)) for n, text in enumerate(table.get("box", ()), 1)]
    points: Any = ()
    if "point" in table:
        given = parse_points(table["point"])
        points = zip(given.names, given.places, strict=True)
    return [
        {
            "kind": kind,
            "name": name,
            "frame": frame,
            **dict(zip("xywh", map(float, place), strict=False)),
        }
        for kind, named in (("boxes", boxes), ("points", points))
        for name, place in named
    ]


def _text(kind: str, shapes: Shapes) -> str:
    """Content of a start file."""
    if kind == "contours":
        return _contours_text(shapes)
    columns = _HEADERS[kind].split(",")
    if kind == "parts":
        return csv_text([columns, *map(_part_row, shapes)])
    keys = ["name" if column == "id" else column for column in columns]
    rows = [[f"{shape[k]:.10g}" if k in "xywh" else shape[k] for k in keys] for shape in shapes]
    return csv_text([columns, *rows])


def _read_boxes(path: Path) -> Shapes:
    table = read_boxes(path, truth=True)
    return [
        {"name": str(name), "frame": int(at), **dict(zip("xywh", box.tolist(), strict=True))}
        for at, name, box in zip(table.frame, table.id, table.box, strict=True)
    ]


def _read_points(path: Path) -> Shapes:
    points = read_points(path)
    shapes = [
        {"name": name, "x": x, "y": y}
        for name, (x, y) in zip(points.names, points.places.tolist(), strict=True)
    ]
    if points.frames is None:
        return shapes
    return [
        {"frame": at, **shape} for at, shape in zip(points.frames.tolist(), shapes, strict=True)
    ]


def _part_row(shape: dict[str, Any]) -> list[str]:
    first, second = (np.array([shape[f"x{end}"], shape[f"y{end}"]], float) for end in (1, 2))
    (x, y), along = (first + second) / 2, second - first
    angle = np.degrees(np.arctan2(along[1], along[0]))
    numbers = (x, y, np.hypot(*along), shape["width"], angle)
    return [shape["name"], shape["parent"], *(f"{number:.2f}" for number in numbers)]


def _read_parts(path: Path) -> Shapes:
    parts = read_parts(path)
    shapes = []
    for number, name in enumerate(parts.names):
        (x, y, angle), (length, width) = parts.poses[number], parts.sizes[number]
        reach = length / 2 * np.array([np.cos(angle), np.sin(angle)])
        ends = zip(("x1", "y1", "x2", "y2"), (x, y, x, y), (*-reach, *reach), strict=True)
        shape = {key: round(float(centre + shift), 2) for key, centre, shift in ends}
        parent = "" if parts.parents[number] < 0 else parts.names[parts.parents[number]]
        shapes.append({"name": name, "parent": parent, "width": width, **shape})
    return shapes


def _contours_text(shapes: Shapes) -> str:
    if len({(shape["closed"], shape["width"]) for shape in shapes}) > 1:
        raise InputError(
            "a file of contours holds either closed contours, or open ones of one width; draw the "
            "others with another --output."
        )
    closed, width = shapes[0]["closed"], shapes[0]["width"]
    for shape in shapes:
        if len(shape["points"]) < 3:
            raise InputError(f"contour '{shape['name']}' has fewer than three points; add some.")
    control = [_control_points(shape["points"], closed) for shape in shapes]
    names = tuple(shape["name"] for shape in shapes)
    return contours_text(Contours(names, np.array(control), closed=closed, width=width))


def _control_points(points: list[list[float]], closed: bool) -> np.ndarray:
    """Control points of the spline closest to a smooth curve through the points."""
    from scipy.interpolate import CubicSpline  # takes half a second

    line = np.array([*points, points[0]] if closed else points, float)
    along = np.concatenate([[0.0], np.cumsum(np.maximum(np.hypot(*np.diff(line.T)), 1e-3))])
    curve = CubicSpline(along, line, bc_type="periodic" if closed else "natural")
    dense = curve(np.linspace(0, along[-1], 200, endpoint=not closed))
    return fit_spline(dense, _CONTROL[closed], closed=closed)


def _read_contours(path: Path) -> Shapes:
    contours = read_contours(path)
    number, closed = contours.points.shape[1], contours.closed
    lines = points_on(contours.points, number, closed=closed, degree=contours.degree)
    return [
        {"name": name, "points": line, "closed": closed, "width": contours.width}
        for name, line in zip(contours.names, lines.round(2).tolist(), strict=True)
    ]


_READERS = {
    "boxes": _read_boxes,
    "points": _read_points,
    "parts": _read_parts,
    "contours": _read_contours,
}
