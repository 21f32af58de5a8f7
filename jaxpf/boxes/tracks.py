"""Boxes and tracks: start boxes, checks, dense arrays, tables of tracks and MOT files.

In memory and in tracks.csv, frames count from 0 and boxes are x, y (top left), w, h in continuous
pixels, with pixel (0, 0) the square [0, 1) x [0, 1).  MOT files count frames and pixels from 1;
only the code that reads or writes a file converts them.
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError, import_extra
from jaxpf.files.reading import check_pixels, parse_number, read_rows
from jaxpf.files.writing import write_text
from jaxpf.sequences.tables import read_boxes as read_boxes

if TYPE_CHECKING:
    import supervision


def read_tracks(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read the columns of a run's tracks.csv, for any kind of target.

    One row per frame and object: frame (from 0), time (seconds), id, coordinates (pixels, angles in
    degrees), their quantiles ``x_2.5``, ``x_97.5``, ..., speed (pixels per second), confidence and
    lost (1 or 0).  ``pandas.DataFrame(read_tracks(path))`` turns it into a data frame.

    Returns:
        name -> values ``[K]``: floats, NaN for an empty field; ``id`` holds integers, or strings if
        some id is not a whole number in its usual notation (such as ``01``).

    Raises:
        InputError: the file cannot be read or contains no tracks.
    """
    (_, header), *rows = read_rows(Path(path), "tracks", "a tracks.csv of a run") or [(1, [])]
    if not {"frame", "time", "id"} <= set(header) or {len(r) for _, r in rows} - {len(header)}:
        raise InputError(f"'{path}' holds no tracks; give the tracks.csv of a run")
    columns: dict[str, np.ndarray] = {}
    for column, name in enumerate(header):
        fields = [row[column] for _, row in rows]
        if name == "id":
            are_usual = all(re.fullmatch(r"0|-?[1-9][0-9]{0,17}", field) for field in fields)
            columns[name] = np.array(fields, int if are_usual else str)
            continue
        try:
            columns[name] = values = np.array([float(field or "nan") for field in fields])
            is_wrong = np.isinf(values) | (np.isnan(values) & (name in ("frame", "time")))
            if is_wrong.any() or (name == "frame" and ((values < 0) | (values % 1 != 0)).any()):
                raise ValueError
        except ValueError:
            kind = "whole numbers from 0 on" if name == "frame" else "finite numbers"
            raise InputError(f"column {name} of '{path}' holds other than {kind}") from None
    columns["frame"] = columns["frame"].astype(int)
    return columns


def parse_box(text: str) -> np.ndarray:
    """Parse a box typed as ``"x,y,w,h"``: float64 [4] in pixels.

    Raises:
        InputError: not four finite numbers, or no positive width and height.
    """
    remedy = "write x,y,w,h in pixels, w and h above 0, such as 120,80,40,90"
    fields = text.split(",")
    if len(fields) != 4:
        raise InputError(f"box '{text}' has {len(fields)} number(s) instead of 4; {remedy}")
    values = [parse_number(field.strip(), f"box '{text}' holds", remedy) for field in fields]
    if min(values[2:]) <= 0:
        raise InputError(f"box '{text}' has no area; {remedy}")
    return np.array(values)


def check_boxes(
    boxes: ArrayLike, width: int, height: int, names: Sequence[object] | None = None
) -> None:
    """Refuse boxes that cannot be tracked; boxes partly outside the frame are accepted.

    Args:
        boxes: x, y, w, h [P, 4].
        width: of the frames, pixels.
        height: of the frames, pixels.
        names: of the boxes, for messages; by default numbers, counting from 1.

    Raises:
        InputError: a box that is not finite, has no area, or lies outside the frame.
    """
    boxes = np.reshape(boxes, (-1, 4)).astype(float)
    check_pixels("the boxes", boxes)
    names = [f"object {number}" for number in range(1, len(boxes) + 1)] if names is None else names
    for name, (x, y, w, h) in zip(names, boxes, strict=True):
        fault = ""
        if not np.isfinite((x, y, w, h)).all() or w <= 0 or h <= 0:
            fault = "has no area; give four finite numbers x,y,w,h, w and h above 0"
        elif x >= width or y >= height or x + w <= 0 or y + h <= 0:
            fault = f"lies outside the {width}x{height} frame; give a box that overlaps it"
        if fault:
            raise InputError(f"the box of {name} ({x:g},{y:g},{w:g},{h:g}) {fault}")


def write_mot(
    path: str | os.PathLike[str],
    frames: ArrayLike,
    ids: ArrayLike,
    boxes: ArrayLike,
    confidence: ArrayLike | None = None,
) -> None:
    """Write rows to a MOT file, which appears under its name only when complete.

    Args:
        path: the file to write or replace.
        frames: int [K], counting from 0 (1 in the file).
        ids: int [K].
        boxes: x, y, w, h [K, 4], counting from 0 (x, y from 1 in the file), to 3 decimals;
            non-finite rows are omitted.
        confidence: [K]; 1 tracked (the default), 0 lost.
    """
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    confidence = np.ones(len(boxes)) if confidence is None else confidence
    columns = np.asarray(frames), np.asarray(ids), boxes, np.asarray(confidence)
    rows = [
        f"{int(frame) + 1},{int(identity)},{x + 1:.3f},{y + 1:.3f},{w:.3f},{h:.3f},"
        f"{float(value):.6g},-1,-1,-1\n"
        for frame, identity, (x, y, w, h), value in zip(*columns, strict=True)
        if np.isfinite((x, y, w, h)).all()
    ]
    write_text(path, "".join(rows))


def to_supervision(
    boxes: ArrayLike, ids: ArrayLike | None = None, confidence: ArrayLike | None = None
) -> "supervision.Detections":
    """Convert the boxes of one frame to ``supervision.Detections``.

    Args:
        boxes: ``[P, 4]``, x, y, w, h in pixels; non-finite ones are omitted.
        ids: ``[P]``; by default from 1.
        confidence: ``[P]``; omitted by default.

    Raises:
        InputError: supervision is missing.
    """
    supervision = import_extra(
        "supervision", "to_supervision needs supervision", "'jaxpf[formats]'"
    )
    boxes = np.asarray(boxes, float)
    there = np.isfinite(boxes).all(axis=-1)
    ids = np.arange(1, len(boxes) + 1) if ids is None else np.asarray(ids, int)
    return supervision.Detections(
        xyxy=np.concatenate([boxes[there, :2], boxes[there, :2] + boxes[there, 2:]], axis=-1),
        confidence=None if confidence is None else np.asarray(confidence, float)[there],
        tracker_id=ids[there],
    )
