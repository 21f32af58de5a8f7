"""Contours that somebody marked in the frames of a clip: masks, outlines or centrelines.

Outlines and centrelines are CSV with the header ``frame,id,k,x,y``: the k-th point of a target in
a frame, in continuous pixels, the same spot of its body in every frame.  Masks are one picture per
frame, in the order of their names.
"""

import csv
from pathlib import Path

import numpy as np

from jaxpf.contours.data import Annotated
from jaxpf.contract.errors import InputError
from jaxpf.contract.names import ANNOTATIONS

#: Values in a mask: one for each target, and some for soft edges.
_MOST_VALUES = 64
_HEADER = ("frame", "id", "k", "x", "y")


def read_annotated(
    folder: Path,
    kind: str | None = None,
    *,
    value: int | None = None,
    first: int = 0,
    last: int | None = None,
) -> Annotated:
    """Read what a folder holds.

    Args:
        folder: with ``centrelines.csv`` or ``outlines.csv``, or with pictures, or with a folder
            ``masks`` of pictures.
        kind: of ``jaxpf.contract.names.ANNOTATIONS``; by default what is there.
        value: of masks, the grey level that marks the target; by default any but 0.
        first: frame from which to read.
        last: frame up to which to read; by default the last.

    Raises:
        InputError: nothing of the kind is there, in these frames; or a line that is none.
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
        raise InputError(f"object {value} is of masks, and '{folder}' gives {kind}; leave it out.")
    until = np.inf if last is None else last
    if kind == "masks":
        found = _read_masks(folder, value, first, until)
    else:
        found = _read_points(folder / f"{kind}.csv", first, until)
    if not found:
        span = f"from {first} on" if last is None else f"{first} to {last}"
        raise InputError(
            f"'{folder}' holds no {kind} in the frames {span}; there are no key frames to learn "
            "from: mark some, or choose other frames."
        )
    return Annotated(kind, found)


def _read_masks(folder: Path, value, first, until) -> dict[tuple[int, str], np.ndarray]:
    import cv2

    from jaxpf.media.images import IMAGE_SUFFIXES, natural_order

    place = folder / "masks" if (folder / "masks").is_dir() else folder
    names = sorted(
        (entry.name for entry in place.iterdir() if entry.suffix.lower() in IMAGE_SUFFIXES),
        key=natural_order,
    )
    found = {}
    for number, name in enumerate(names):
        if not first <= number <= until:
            continue
        picture = cv2.imread(str(place / name), cv2.IMREAD_UNCHANGED)
        if picture is None:
            raise InputError(f"'{place / name}' is no picture; replace or remove it.")
        _check_mask(place / name, picture)
        levels = picture if picture.ndim == 2 else picture[..., :3].max(axis=-1)
        marked = levels != 0 if value is None else levels == value
        if marked.any():
            found[number, "1"] = marked
    return found


def _check_mask(path: Path, picture: np.ndarray) -> None:
    """Refuse photographs: a mask has a value for each target, and one where there is none."""
    values = picture.reshape(len(picture) * picture.shape[1], -1)
    found = len(np.unique(values, axis=0))
    if found > _MOST_VALUES:
        kind = "grey levels" if values.shape[1] == 1 else "colours"
        raise InputError(
            f"'{path}' holds {found} {kind}, as a photograph does, and a mask has few; give "
            "pictures that are 0 but on the target, without loss (PNG, not JPEG)."
        )


def _read_points(path: Path, first, until) -> dict[tuple[int, str], np.ndarray]:
    points: dict[tuple[int, str], dict[int, tuple[float, float]]] = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            header = tuple(name.strip() for name in next(rows, ()))
            if header != _HEADER:
                raise InputError(
                    f"'{path}' begins with {','.join(header)[:80]!r}; its first line must be "
                    f"{','.join(_HEADER)}."
                )
            for row in filter(None, rows):
                try:
                    frame, name, k, x, y = row
                    number, place = int(frame), (float(x), float(y))
                    if not np.isfinite(place).all():
                        raise ValueError
                    if first <= number <= until:
                        points.setdefault((number, name), {})[int(k)] = place
                except ValueError:
                    raise InputError(
                        f"'{path}', line {rows.line_num}: {','.join(row)[:80]!r} is not "
                        f"{','.join(_HEADER)} with whole frames and k, and finite x and y."
                    ) from None
    except FileNotFoundError:
        raise InputError(f"there is no '{path}'; give a folder that has it.") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read '{path}': {error}.") from error
    return {
        key: np.array([places[k] for k in sorted(places)]) for key, places in sorted(points.items())
    }
