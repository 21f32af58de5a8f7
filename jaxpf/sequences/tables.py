"""Tables of boxes: gt.csv and tracks.csv, and the lines of MOTChallenge, CVAT and VisDrone.

In memory, frames count from 0 and boxes are x, y (top left), w, h in continuous pixels, with pixel
(0, 0) the square [0, 1) x [0, 1).  A row whose width or height is 0 marks an absent object.
"""

import dataclasses
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.files.reading import FARTHEST, LARGEST_WHOLE, check_pixels, parse_number, read_rows

#: Most numbers, or runs of them, in a message.
_LISTED = 12
_BOX = ("frame", "id", "x", "y", "w", "h")
_TRACKS = ("frame", "time", *_BOX[1:])
#: Names of the columns of files without a header.
_MOT = (*_BOX, "confidence", "class", "visibility", "unused")
_VISDRONE = (*_BOX, "confidence", "class", "truncation", "occ")
#: Column -> lowest and highest value, and whether it is a whole number.
_RANGES = {
    "frame": (0, LARGEST_WHOLE, True),
    "id": (-LARGEST_WHOLE, LARGEST_WHOLE, True),
    "w": (0, FARTHEST, False),
    "h": (0, FARTHEST, False),
    "occ": (-1, 2, True),
}
#: Classes that the benchmarks evaluate: MOTChallenge's pedestrian, and VisDrone's without ignored
#: regions (0) and others (11); -1 if a file has no classes.
_PEDESTRIAN, _OF_VISDRONE = {1, -1}, set(range(1, 11))
_FORMATS = (
    "a header 'frame,id,x,y,w,h,occ' (occ may be absent; frames and pixels count from 0), or MOT "
    "lines without header, 'frame,id,x,y,w,h,conf,-1,-1,-1' (counting from 1), of 6 to 10 columns"
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

    def __len__(self) -> int:
        return len(self.frame)


def read_boxes(path: str | os.PathLike[str], *, truth: bool = False) -> BoxTable:
    """Read the boxes of a file.

    * With a header ``frame,id,x,y,w,h``, ``frame,id,x,y,w,h,occ`` or that of a tracks.csv: frames
      and pixels count from 0.
    * MOTChallenge, without header: 6 to 10 columns ``frame,id,x,y,w,h,conf,class,visibility``;
      frames and pixels count from 1 in the file (pixels from 0 in a ``gt.txt`` beside CVAT's
      ``labels.txt``).  As in the benchmark's evaluation (Milan et al. 2016, MOT16), rows of truth
      count only if conf is not 0 and, with 8 or 9 columns, the class is 1, a pedestrian, or -1.
    * VisDrone, without header: ``frame,id,x,y,w,h,score,category,truncation,occlusion``; pixels
      count from 0.  Rows of score 0, ignored regions and "others" do not count.

    A row of zero width or height marks an absent object, and is left out.

    Args:
        path: the file; separated by commas, semicolons or tabs, blank lines are skipped.
        truth: whether the file holds ground truth, of which only the rows that count are read; of
            a tracker's results all are.

    Returns:
        The rows that count, in the order of the file.

    Raises:
        InputError: a line has too few or too many columns, a value that is no number in its range,
            or repeats a frame and an id; the message names it.
    """
    line_of: dict[tuple[float, ...], int] = {}
    rows = []
    for line, row in box_rows(path, truth):
        if (first := line_of.setdefault(row[:2], line)) != line:
            raise InputError(
                f"line {line} of '{path}' repeats id {row[1]:.0f} in the frame of line {first}; "
                "keep one of the two lines"
            )
        if min(row[4:6]) > 0:
            rows.append(row)
    return table_of(rows, path)


def table_of(rows: Sequence[tuple[float, ...]], path: str | os.PathLike[str]) -> BoxTable:
    """Convert rows from ``box_rows`` to a table.

    Raises:
        InputError: the boxes are shares of the frame's width and height.
    """
    columns = np.array(rows, np.float64).reshape(-1, 8)
    box = columns[:, 2:6]
    check_pixels(f"the boxes of '{path}'", box)
    return BoxTable(
        frame=columns[:, 0].astype(np.int64),
        id=columns[:, 1].astype(np.int64),
        box=box,
        occlusion=columns[:, 6].astype(np.int64),
        confidence=columns[:, 7],
        source=f"'{path}'",
    )


def box_rows(
    path: str | os.PathLike[str], truth: bool = False
) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield line number and (frame, id, x, y, w, h, occlusion, confidence) of rows that count.

    Frames and pixels count from 0; for ``truth`` see ``read_boxes``.
    """
    path = Path(path)
    rows = read_rows(path, "boxes", _FORMATS)
    header = tuple(name.lower() for name in rows[0][1]) if rows else ()
    names, first, pixel, classes = _MOT[: len(header)], 1, 1, None
    if header in (_BOX, (*_BOX, "occ")) or header[:7] == _TRACKS:
        names, first, pixel, rows = header, 0, 0, rows[1:]
    elif _is_visdrone(rows):
        names, pixel, classes = _VISDRONE, 0, _OF_VISDRONE
    elif path.name == "gt.txt" and (path.parent / "labels.txt").is_file():
        pixel = 0  # CVAT's
    elif len(header) in (8, 9):
        classes = _PEDESTRIAN
    if not rows or not len(header) >= 6 or len(names) < len(header) or rows[0][1][0].isalpha():
        state = f"begins with {','.join(header)[:80]!r}" if rows else "holds no boxes"
        raise InputError(f"'{path}' {state}; expected {_FORMATS}")
    for line, fields in rows:
        place = f"line {line} of '{path}'"
        if len(fields) != len(names):
            raise InputError(
                f"{place} has {len(fields)} columns; expected {len(names)}, {','.join(names)}"
            )
        row = dict(zip(names, fields, strict=True))

        def value(name: str, default: float = -1.0, row=row, place=place) -> float:
            if name in row and (name in _BOX or row[name]):
                least, most, whole = _RANGES.get(name, (-FARTHEST, FARTHEST, False))
                least = first if name == "frame" else least
                named = f"{place}: {name} is"
                remedy = "give a number, or delete the line"
                return parse_number(row[name], named, remedy, least=least, most=most, whole=whole)
            return default

        frame, number, x, y, w, h = map(value, _BOX)
        confidence = value("confidence", 1 - value("lost", 0.0))
        kind = value("class") if classes else -1
        is_flagged = confidence == 0 and "time" not in row
        is_ignored = is_flagged or (classes is not None and kind not in classes)
        hidden = value("occ", _occlusion(value("visibility")) if classes else -1)
        if not (is_ignored and (truth or names is _VISDRONE)):
            yield line, (frame - first, number, x - pixel, y - pixel, w, h, hidden, confidence)


def dense(table: BoxTable, ids: Sequence[int], num_frames: int) -> np.ndarray:
    """Boxes of ``ids`` in frames 0 to num_frames - 1, float64 ``[num_frames, len(ids), 4]``.

    NaN where an object has no box; later frames are ignored.
    """
    available = set(table.id.tolist())
    boxes = np.full((num_frames, len(ids), 4), np.nan)
    for column, identity in enumerate(ids):
        if identity not in available:
            raise InputError(
                f"id {identity} does not occur in {table.source}; its ids are "
                f"{listed(sorted(available))}"
            )
        rows = (table.id == identity) & (table.frame >= 0) & (table.frame < num_frames)
        boxes[table.frame[rows], column] = table.box[rows]
    return boxes


def listed(values: Iterable[int]) -> str:
    """Format ``1, 2, 3``, with runs of integers as ``0-70``; shortened if there are many."""
    runs: list[list[int]] = []
    for number in map(int, values):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    parts: list[str] = []
    for first, last in runs:
        parts += [f"{first}-{last}"] if last - first > 1 else map(str, range(first, last + 1))
    return ", ".join(parts[:_LISTED]) + (", ..." if len(parts) > _LISTED else "")


def _is_visdrone(rows: list[tuple[int, list[str]]]) -> bool:
    """Whether all rows end in score, category, truncation and occlusion of VisDrone's truth."""
    ends = {tuple(fields[6:]) for _, fields in rows if len(fields) == 10}
    # An ignored region, of category 0, has the score 0.
    return any(end[1] != "0" for end in ends) and all(
        score in ("0", "1")
        and category.isdecimal()
        and int(score) <= int(category) < 12
        and truncation in ("0", "1")
        and occlusion in ("0", "1", "2")
        for score, category, truncation, occlusion in ends
    )


def _occlusion(visibility: float) -> int:
    if not 0 <= visibility <= 1:
        return -1
    return 0 if visibility == 1 else 1 if visibility >= 0.5 else 2
