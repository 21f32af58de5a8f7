"""Reads boxes from MOT files and ``gt.csv`` files into a table."""

import dataclasses
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_array
from jaxpf.files.reading import parse_number, read_rows

HEADERS = ("frame,id,x,y,w,h", "frame,id,x,y,w,h,occ")
#: Beginning of the header of a tracks.csv of boxes; its frames and pixels count from 0.
TRACKS_HEADER = "frame,time,id,x,y,w,h"
#: Limits of coordinates in pixels, and of frames and ids, beyond which floats lose precision.
_FARTHEST, _LARGEST_WHOLE = 1e9, 2**53
_FORMATS = (
    f"a header '{HEADERS[1]}' (occ may be absent; frames and pixels count from 0), or MOT lines "
    "without header, 'frame,id,x,y,w,h,conf,-1,-1,-1' (counting from 1)"
)


@dataclasses.dataclass(frozen=True, eq=False)
class BoxTable:
    """Boxes of objects in frames, one row each, in the order of the file.

    Attributes:
        frame: int [K], counting from 0.
        id: int [K], the object's number.
        box: float64 [K, 4]: x, y (the top left corner), w, h in continuous pixels; pixel (0, 0)
            is the square [0, 1) x [0, 1).
        occlusion: int [K]: 0 visible, 1 partly hidden, 2 mostly or fully hidden, -1 unknown.
        confidence: float64 [K]; 1 if the file has none.
        source: origin of the rows, for messages.
    """

    frame: np.ndarray
    id: np.ndarray
    box: np.ndarray
    occlusion: np.ndarray
    confidence: np.ndarray
    source: str = "the table"

    def __post_init__(self) -> None:
        check_array("frame", self.frame, "the frame of every row, from 0, [K]")
        for name in ("id", "occlusion", "confidence"):
            check_array(name, getattr(self, name), f"one for every row, [{len(self.frame)}]")
        check_array("box", self.box, f"x, y, w, h of every row, [{len(self.frame)}, 4]")

    def __len__(self) -> int:
        return len(self.frame)


def read_boxes(path: str | os.PathLike[str], empty_boxes: str = "error") -> BoxTable:
    """Read a MOT file or a ``gt.csv``, distinguished by the header.

    * MOT: no header, 6 to 10 columns ``frame,id,x,y,w,h,conf,...``; frames and x, y count from
      1 in the file and are converted (a ``gt.txt`` beside a ``labels.txt`` is CVAT's, whose
      pixels count from 0).  Columns after ``conf`` are checked and ignored.
    * ``gt.csv``: header ``frame,id,x,y,w,h`` or ``frame,id,x,y,w,h,occ``; counts from 0.

    Args:
        path: the file; UTF-8, separated by commas, blank lines are skipped.
        empty_boxes: treatment of a width or height of exactly 0.  ``"error"`` refuses it;
            ``"absent"`` drops the row, because some annotations mark absent objects this way.  A
            negative size is always an error.

    Returns:
        The rows in the order of the file.

    Raises:
        InputError: a line is invalid; the message names it and a remedy.
    """
    if empty_boxes not in ("error", "absent"):
        raise InputError(f"empty_boxes={empty_boxes!r:.60} must be 'error' or 'absent'.")
    path = Path(path)
    rows: list[tuple[float, ...]] = []
    line_of: dict[tuple[int, int], int] = {}
    for line, row in parsed_lines(path):
        frame, identity, _, _, width, height = row[:6]
        place = f"line {line} of '{path}'"
        key = (int(frame), int(identity))
        if key in line_of:
            raise InputError(
                f"{place} repeats id {key[1]} in the frame of line {line_of[key]}; keep one of "
                "the two lines"
            )
        line_of[key] = line
        if width < 0 or height < 0:
            raise InputError(
                f"{place} has a box of negative size {width:g} x {height:g}; w and h are a width "
                "and a height, not a second corner"
            )
        if width == 0 or height == 0:
            if empty_boxes == "error":
                raise InputError(
                    f"{place} has a box of zero size {width:g} x {height:g}; give it a width and "
                    "a height, or delete the line"
                )
            continue
        rows.append(row)
    if not line_of:
        raise InputError(f"'{path}' holds no boxes; expected {_FORMATS}")
    return table_of(rows, path)


def table_of(rows: Sequence[tuple[float, ...]], path: str | os.PathLike[str]) -> BoxTable:
    """Convert rows from ``parsed_lines`` to a table."""
    columns = np.array(rows, np.float64).reshape(-1, 8)
    return BoxTable(
        frame=columns[:, 0].astype(np.int64),
        id=columns[:, 1].astype(np.int64),
        box=columns[:, 2:6],
        occlusion=columns[:, 6].astype(np.int64),
        confidence=columns[:, 7],
        source=f"'{path}'",
    )


def parsed_lines(path: Path) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield (line number, (frame, id, x, y, w, h, occlusion, confidence)), counting from 0."""
    rows = read_rows(path, "boxes", _FORMATS)
    if not rows:
        raise InputError(f"'{path}' is empty; expected {_FORMATS}")
    # CVAT's MOT archives, gt/gt.txt beside gt/labels.txt, count pixels from 0 and frames from 1.
    is_cvat = path.name == "gt.txt" and (path.parent / "labels.txt").is_file()
    header, first_pixel = None, 0 if is_cvat else 1
    columns: list[str] = []
    line, fields = rows[0]
    if _is_header(fields[0]):
        header, first_pixel, rows = ",".join(fields).lower(), 0, rows[1:]
        if header.startswith(TRACKS_HEADER):
            columns, header = header.split(","), HEADERS[0]
        elif header not in HEADERS:
            raise InputError(
                f"line {line} of '{path}' has an unknown header '{','.join(fields)[:80]}'; "
                f"expected {_FORMATS}"
            )
    for line, fields in rows:
        place = f"line {line} of '{path}'"
        if not columns:
            yield line, _parse_row(fields, header, first_pixel, place)
            if len(fields) != len(rows[0][1]):
                raise InputError(
                    f"{place} has {len(fields)} columns and line {rows[0][0]} has "
                    f"{len(rows[0][1])}; give every line the same columns (decimals with a point)"
                )
        elif len(fields) != len(columns):
            raise InputError(f"{place} has {len(fields)} columns instead of {len(columns)}")
        else:
            row = dict(zip(columns, fields, strict=True))
            box = _parse_row([row[name] for name in HEADERS[0].split(",")], header, 0, place)
            lost = parse_number(row.get("lost") or "0", f"{place}: lost is", "give 0 or 1")
            confidence = parse_number(
                row.get("confidence") or str(1 - lost), f"{place}: confidence is", "give a number"
            )
            yield line, (*box[:-1], confidence)


def _parse_row(
    fields: list[str], header: str | None, first_pixel: int, place: str
) -> tuple[float, ...]:
    if header is not None:
        least = most = header.count(",") + 1
        names, counts = header, f"{least}"
    else:
        least, most = 6, 10
        names, counts = "frame,id,x,y,w,h,conf,...", "6 to 10"
    if not least <= len(fields) <= most:
        raise InputError(
            f"{place} has {len(fields)} columns; expected {counts}: {names} (decimals with a point)"
        )
    if "" in fields:
        column = fields.index("") + 1
        raise InputError(f"{place} has nothing in column {column}; fill in a number")
    values = [
        parse_number(field, f"{place}, column {column} is", "give a number, or delete the line")
        for column, field in enumerate(fields, start=1)
    ]
    if _has_decimal_commas(fields):
        raise InputError(
            f"{place} has 10 columns, of which the last four look like a width and a height with "
            f"decimal commas; write decimals with a point, such as {'.'.join(fields[6:8])}"
        )
    for value, name in zip(values[:2], ("frame", "id"), strict=True):
        if value != int(value):
            raise InputError(f"{place} has the {name} {value:g}; give a whole number")
        if abs(value) >= _LARGEST_WHOLE:
            field = fields[("frame", "id").index(name)]
            raise InputError(
                f"{place} has the {name} {field[:40]}; give one below {_LARGEST_WHOLE}, up to "
                "which whole numbers are exact"
            )
    first = 0 if header is not None else 1
    if values[0] < first:
        convention = "this file counts" if header is not None else "MOT files count"
        raise InputError(
            f"{place} has the frame {values[0]:g}; {convention} frames from {first}, so shift "
            "them or correct the line"
        )
    occlusion = values[6] if header == HEADERS[1] else -1
    confidence = values[6] if header is None and len(values) > 6 else 1.0
    frame, identity, x, y, width, height = values[:6]
    if any(abs(value) > _FARTHEST for value in (x, y, width, height)):
        raise InputError(
            f"{place} has a box beyond {_FARTHEST:.0f} pixels; give x, y, w and h in pixels"
        )
    if occlusion not in (-1, 0, 1, 2):
        raise InputError(f"{place} has the occ {occlusion:g}; give -1, 0, 1 or 2")
    x, y = x - first_pixel, y - first_pixel
    return frame - first, identity, x, y, width, height, occlusion, confidence


def _has_decimal_commas(fields: list[str]) -> bool:
    """Whether ``1,1,10,5,20,5,30,0,40,0`` was meant as frame, id and a box of 10.5, 20.5, 30, 40.

    Ten valid MOT columns end in -1,-1,-1, in zeros, or in a position with decimals.
    """
    if len(fields) != 10 or not all(field.isdecimal() for field in fields[6:]):
        return False
    return all(float(".".join(fields[k : k + 2])) > 0 for k in (6, 8))


def _is_header(field: str) -> bool:
    """Whether a first field starts a header; ``nan`` and ``1x`` are bad numbers, not headers."""
    return field[:1].isalpha() and field.lower() not in ("nan", "inf", "infinity")
