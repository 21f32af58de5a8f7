"""Reads annotated real sequences from folders; pictures are decoded on demand.

A folder contains

* ``meta.json``: ``name``, ``frames`` (a video file, or a pattern such as ``frames/%04d.png``
  counted from 0), ``n_frames``, ``width``, ``height``, ``fps``;
* ``gt.csv``: a header ``frame,id,x,y,w,h,occ`` and one line per frame and object, frames counted
  from 0, (x, y) the box's top left corner in pixels, and occ 0 visible, 1 partly hidden, 2 mostly
  or fully hidden, -1 not annotated; the last column is optional.
"""

import codecs
import csv
import dataclasses
import io
import json
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from scenes.scene import SceneError, shown

NOT_ANNOTATED = -1
#: (frame, id) -> (box, occlusion), frames counted from 0.
Rows = dict[tuple[int, int], tuple[list[float], int]]

_COLUMNS = ["frame", "id", "x", "y", "w", "h", "occ"]
#: The numbers of meta.json and their upper limits, which keep array sizes plausible.
_META_NUMBERS = {"n_frames": 10**6, "width": 10**5, "height": 10**5, "fps": 10**6}
#: Limits of coordinates in pixels and of ids, beyond which floats lose precision.
_FARTHEST, _LARGEST_WHOLE = 1e9, 2**53


@dataclasses.dataclass(frozen=True, eq=False)
class Clip:
    """An annotated sequence on disk; ``scenes.start_scene`` converts it to a ``Scene``.

    Attributes:
        name: of the clip.
        folder: its location.
        source: the video file, or the pattern of the picture files, relative to the folder.
        first_number: number of frame 0 in the pattern; frame t has number first_number + t.
        description: the file that specifies ``num_frames``, ``width`` and ``height``.
        num_frames: T.
        width: width of a frame in pixels.
        height: height of a frame in pixels.
        fps: frames per second.
        ids: ids of the P objects in the annotation, ascending.
        boxes: ``[T, P, 4]`` float, the true boxes (x, y, w, h) in pixels, (x, y) the top left
            corner; NaN where an object has no line.
        occlusion: ``[T, P]`` int, 0 visible, 1 partly hidden, 2 mostly or fully hidden, -1 not
            annotated or no line.
    """

    name: str
    folder: Path
    source: str
    num_frames: int
    width: int
    height: int
    fps: float
    ids: tuple[int, ...]
    boxes: np.ndarray
    occlusion: np.ndarray
    first_number: int = 0
    description: str = "meta.json"

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[np.ndarray]:
        """Yield the pictures ``[H, W, 3]`` uint8, RGB, of frames ``start`` to ``stop - 1``.

        By default all frames.
        """
        return self.pictures(range(start, self.num_frames if stop is None else stop))

    def pictures(self, numbers: Sequence[int]) -> Iterator[np.ndarray]:
        """Yield the pictures ``[H, W, 3]`` uint8, RGB, of the frames with these numbers, ascending.

        Raises:
            SceneError: a picture is missing or has another size, or the video is shorter.
        """
        read = self._read_pictures if "%" in self.source else self._read_video
        decoded = read(numbers)
        for number in numbers:
            picture = next(decoded, None)
            if picture is None:
                raise SceneError(
                    f"{self.folder / self.source} ends before frame {number}, but "
                    f"{self.description} says that there are {self.num_frames}"
                )
            if picture.shape != (self.height, self.width, 3):
                raise SceneError(
                    f"{self.folder / self.source}: frame {number} measures {picture.shape[1]} x "
                    f"{picture.shape[0]}, but {self.description} says {self.width} x {self.height}"
                )
            yield np.ascontiguousarray(picture[..., ::-1])  # OpenCV decodes to BGR

    def _read_pictures(self, numbers: Sequence[int]) -> Iterator[np.ndarray]:
        for frame in numbers:
            path = self.folder / (self.source % (self.first_number + frame))
            picture = cv2.imread(str(path), cv2.IMREAD_COLOR) if path.is_file() else None
            if picture is None:
                raise SceneError(f"{path}: frame {frame} is missing or is not a picture")
            yield picture

    def _read_video(self, numbers: Sequence[int]) -> Iterator[np.ndarray]:
        video = cv2.VideoCapture(str(self.folder / self.source))
        position = 0
        try:
            for frame in numbers:
                while position <= frame:
                    if not video.grab():
                        return
                    position += 1
                is_read, picture = video.retrieve()
                if not is_read:
                    return
                yield picture
        finally:
            video.release()


def cut_patch(picture: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Copy the pixels of ``picture [H, W, ...]`` that a box (x, y, w, h) covers.

    Edges are rounded to whole pixels, halves to even.  A box partly outside the picture is clipped;
    a box wholly outside gives a patch of size 0.
    """
    x, y, w, h = box
    left, right = np.clip(np.rint([x, x + w]).astype(int), 0, picture.shape[1])
    top, bottom = np.clip(np.rint([y, y + h]).astype(int), 0, picture.shape[0])
    return picture[top:bottom, left:right].copy()


def read_clip(folder: str | Path) -> Clip:
    """Open an annotated sequence: read ``meta.json`` and ``gt.csv``, but no pictures."""
    folder = Path(folder)
    if not folder.is_dir():
        raise SceneError(f"{folder}: there is no such folder")
    meta = _read_meta(folder / "meta.json")
    source = meta["frames"]
    is_pattern = "%" not in source or re.fullmatch(r"[^%]*%(0?[1-9])?d[^%]*", source)
    if not is_pattern or len(source) > 200:
        raise SceneError(
            f"{folder / 'meta.json'}: frames = {shown(source)} is no pattern; name a video, or "
            "pictures with one number, such as frames/%04d.png"
        )
    first = folder / (source % 0 if "%" in source else source)
    if not first.is_file():
        raise SceneError(f"{first} is missing: meta.json names {source!r} as the frames")
    rows = _read_truth(folder / "gt.csv", meta["n_frames"])
    ids, boxes, occlusion = tabulated(rows, meta["n_frames"])
    return Clip(
        name=str(meta["name"]),
        folder=folder,
        source=source,
        num_frames=meta["n_frames"],
        width=meta["width"],
        height=meta["height"],
        fps=float(meta["fps"]),
        ids=ids,
        boxes=boxes,
        occlusion=occlusion,
    )


def tabulated(rows: Rows, num_frames: int) -> tuple[tuple[int, ...], np.ndarray, np.ndarray]:
    """Convert rows to ``ids``, ``boxes`` and ``occlusion`` of a ``Clip``."""
    ids = tuple(sorted({number for _, number in rows}))
    boxes = np.full((num_frames, len(ids), 4), np.nan)
    occlusion = np.full(boxes.shape[:2], NOT_ANNOTATED)
    for (frame, number), (box, hidden) in rows.items():
        boxes[frame, ids.index(number)] = box
        occlusion[frame, ids.index(number)] = hidden
    return ids, boxes, occlusion


def _read_meta(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise SceneError(f"{path} is missing: a clip's folder needs meta.json and gt.csv")
    text = text_of(path)
    try:
        meta = json.loads(text)
    except RecursionError:
        raise SceneError(f"{path} is not valid JSON: it is nested too deeply") from None
    except ValueError as error:
        raise SceneError(f"{path} is not valid JSON: {str(error).partition(';')[0]}") from error
    if not isinstance(meta, dict):
        raise SceneError(f"{path} must hold an object with names and values")
    for key in ["name", "frames"]:
        if not isinstance(meta.get(key), str):
            raise SceneError(f"{path}: {key} = {shown(meta.get(key))} must be text")
    for key, most in _META_NUMBERS.items():
        value = meta.get(key)
        kinds = (int, float) if key == "fps" else (int,)
        if isinstance(value, bool) or not isinstance(value, kinds) or not value > 0:
            raise SceneError(f"{path}: {key} = {shown(value)} must be a number above 0")
        if value > most:
            raise SceneError(f"{path}: {key} = {shown(value)} must be at most {most}")
    return meta


def _read_truth(path: Path, num_frames: int) -> Rows:
    if not path.is_file():
        raise SceneError(f"{path} is missing: a clip's folder needs meta.json and gt.csv")
    rows: Rows = {}
    for place, cells in _csv_lines(path):
        frame, number = (whole_number(cells[k], _COLUMNS[k], place) for k in (0, 1))
        hidden = NOT_ANNOTATED if len(cells) < 7 else whole_number(cells[6], _COLUMNS[6], place)
        box = [real_number(cells[k], _COLUMNS[k], place) for k in (2, 3, 4, 5)]
        if not 0 <= frame < num_frames:
            raise SceneError(f"{place}: frame must lie in 0..{num_frames - 1}")
        if box[2] <= 0 or box[3] <= 0:
            raise SceneError(f"{place}: w and h must be above 0")
        if hidden not in (NOT_ANNOTATED, 0, 1, 2):
            raise SceneError(f"{place}: occ must be -1, 0, 1 or 2")
        if (frame, number) in rows:
            raise SceneError(f"{place}: a second box for object {number} in frame {frame}")
        rows[frame, number] = (box, hidden)
    return rows


def _csv_lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield (place for messages, cells) of every non-empty line below the header.

    Raises:
        SceneError: a wrong header, or a line with too few or too many values.
    """
    text = text_of(path)
    first = text.lstrip("\n\r \t").splitlines()[:1]
    separator = next((mark for mark in ";\t" if first and mark in first[0]), ",")
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    rows = (cells for cells in lines if any(cell.strip() for cell in cells))
    try:
        header = next(rows, [])
        names = [name.strip().lower() for name in header]
        if names not in (_COLUMNS, _COLUMNS[:-1]):
            raise SceneError(
                f"{path}, line 1: the header must be {','.join(_COLUMNS)!r}, occ being optional, "
                f"not {shown(','.join(header))}"
            )
        for cells in rows:
            place = f"{path}, line {lines.line_num}: {shown(','.join(cells))}"
            if len(cells) != len(names):
                raise SceneError(f"{place} has {len(cells)} values, not {len(names)}")
            yield place, cells
    except csv.Error as error:
        raise SceneError(f"{path}, line {lines.line_num} is no CSV: {error}") from None


def text_of(path: Path) -> str:
    """Read a text file in UTF-8 or UTF-16.

    Raises:
        SceneError: it cannot be read, or holds a byte that is no UTF-8.
    """
    try:
        content = path.read_bytes()
        is_utf_16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise SceneError(
            f"{path}, line {line} holds a byte that is no UTF-8; save the file as UTF-8"
        ) from None
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}") from error


def whole_number(text: str, column: str, place: str) -> int:
    """Parse a cell as an integer; messages name the column and the place."""
    value = _number(text)
    if not (math.isfinite(value) and value == int(value)):
        raise SceneError(f"{place}: {column} = {shown(text)} is not a whole number{_hint(text)}")
    if abs(value) > _LARGEST_WHOLE:
        raise SceneError(f"{place}: {column} = {shown(text)} is beyond {_LARGEST_WHOLE}")
    return int(value)


def real_number(text: str, column: str, place: str) -> float:
    """Parse a cell as a finite number; messages name the column and the place."""
    value = _number(text)
    if not math.isfinite(value):
        raise SceneError(f"{place}: {column} = {shown(text)} is not a finite number{_hint(text)}")
    if abs(value) > _FARTHEST:
        raise SceneError(f"{place}: {column} = {shown(text)} is beyond {_FARTHEST:.0f}")
    return value


def _number(text: str) -> float:
    try:
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def _hint(text: str) -> str:
    has_comma = re.fullmatch(r"\s*[+-]?\d+,\d+\s*", text)
    return f"; write decimals with a point, {text.strip().replace(',', '.')}" if has_comma else ""
