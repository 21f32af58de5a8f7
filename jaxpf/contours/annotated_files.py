"""Reads contours annotated in the frames of a clip: masks, outlines or centrelines.

Outlines and centrelines are CSV with the header ``frame,id,k,x,y``: the k-th point of a target in
a frame, in continuous pixels; k marks the same spot of the body in every frame.  The outlines.csv
of a run is read, too, but for its control points.  Masks are one
picture per frame; the number in the name is the frame's number, and if no name has one, the order
of the names counts.
"""

from pathlib import Path

import numpy as np

from jaxpf.contours.data import Annotated
from jaxpf.contours.files import TRACK_HEADER
from jaxpf.contract.errors import InputError
from jaxpf.files.reading import parse_number, read_below
from jaxpf.media.images import read_mask
from jaxpf.sequences.layouts import label_images
from jaxpf.shapes.learning import ANNOTATIONS

_HEADER = ("frame", "id", "k", "x", "y")


def read_annotated(
    folder: Path,
    kind: str | None = None,
    *,
    value: int | None = None,
    first: int = 0,
    last: int | None = None,
) -> Annotated:
    """Read the annotations in a folder.

    Args:
        folder: contains ``centrelines.csv`` or ``outlines.csv``, or pictures, or a folder ``masks``
            of pictures.
        kind: of ``ANNOTATIONS``; by default the kind found.
        value: of masks, the number of the object: its palette index or grey level.  Optional if
            there is only one object.
        first: first frame to read.
        last: last frame to read; by default the last one.

    Raises:
        InputError: no annotations of the kind in these frames, or an invalid line.
    """
    if not folder.is_dir():
        raise InputError(f"there is no folder at '{folder}'; check the path.")
    if first < 0 or (last is not None and last < first):
        end = "on" if last is None else f"to {last}"
        raise InputError(f"there are no frames from {first} {end}; count from 0, upwards.")
    if kind is None:
        there = [name for name in ANNOTATIONS[1:] if (folder / f"{name}.csv").is_file()]
        kind = there[-1] if there else "masks"
    if value is not None and kind != "masks":
        raise InputError(
            f"object {value} selects a mask, and '{folder}' holds {kind}; leave it out."
        )
    until = np.inf if last is None else last
    if kind == "masks":
        outlines = _read_masks(folder, value, first, until)
    else:
        outlines = _read_points(folder / f"{kind}.csv", first, until)
    if not outlines:
        span = f"from {first} on" if last is None else f"{first} to {last}"
        raise InputError(
            f"'{folder}' holds no {kind} in the frames {span}; there are no key frames to learn "
            "from: mark some, or choose other frames."
        )
    return Annotated(kind, outlines)


def _read_masks(folder: Path, value, first, until) -> dict[tuple[int, str], np.ndarray]:
    place = folder / "masks" if (folder / "masks").is_dir() else folder
    masks: dict[tuple[int, str], np.ndarray] = {}
    objects: set[int] = set()
    size: tuple[int, ...] = ()
    for number, path in label_images(place).items():
        if not first <= number <= until:
            continue
        levels = read_mask(path)
        size = size or levels.shape
        if levels.shape != size:
            raise InputError(
                f"mask '{path}' is {levels.shape[1]}x{levels.shape[0]} and the masks "
                f"before it are {size[1]}x{size[0]}; give masks of one size, that of the frames."
            )
        objects |= set(np.unique(levels[levels > 0]).tolist())
        marked = levels > 0 if value is None else levels == value
        if marked.any():
            masks[number, "1"] = marked
    if value is None and len(objects) > 1:
        raise InputError(
            f"the masks in '{place}' hold the objects {', '.join(map(str, sorted(objects)))}; "
            "choose one by --object."
        )
    if value is not None and objects and value not in objects:
        raise InputError(
            f"the masks in '{place}' hold no object {value}; there are "
            f"{', '.join(map(str, sorted(objects)))}."
        )
    return masks


def _read_points(path: Path, first, until) -> dict[tuple[int, str], np.ndarray]:
    points: dict[tuple[int, str], dict[int, tuple[float, float]]] = {}
    for where, fields in read_below(path, "contours", ",".join(_HEADER), TRACK_HEADER):
        if fields[5:] == ["control"]:
            continue
        number, k, x, y = (
            parse_number(field, f"{where}: {name} is", "give a number", whole=name not in "xy")
            for name, field in zip(_HEADER, fields[: len(_HEADER)], strict=True)
            if name != "id"
        )
        if first <= number <= until:
            points.setdefault((int(number), fields[1]), {})[int(k)] = x, y
    lines = {key: np.array([line[j] for j in sorted(line)]) for key, line in sorted(points.items())}
    for (number, name), places in lines.items():
        if (places == places[0]).all():
            raise InputError(
                f"'{path}' has fewer than two different points of target '{name}' in frame "
                f"{number}; add points, or delete its lines."
            )
    return lines
