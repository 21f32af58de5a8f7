"""Tracks in the formats of other projects: COCO, CVAT and ``movement``.

All read the output folder of ``jaxpf track`` and keep the objects' ids.  In memory, frames and
pixels count from 0, and pixel (0, 0) is the square [0, 1) x [0, 1).  File conventions:

=================  ============  ===========  ==================================
format             first frame   first pixel  position
=================  ============  ===========  ==================================
MOT, tracks.csv    1             1            top left corner, width and height
coco               image id 1    0            top left corner, width and height
cvat (MOT 1.1)     1             0            top left corner, width and height
movement (netCDF)  seconds       0            centre, width and height
=================  ============  ===========  ==================================

Seconds are frame timestamps, which differ from index / fps where the frame rate varies.
"""

import csv
import dataclasses
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.boxes.tables import read_boxes
from jaxpf.boxes.tracks import dense, read_tracks, write_mot
from jaxpf.contract.errors import InputError
from jaxpf.files.reading import read_text
from jaxpf.files.writing import atomic_path, atomic_write, report_os_errors, write_text
from jaxpf.media.video import open_frames

#: Category of all tracked objects.
_LABEL = "object"
_INTERVAL = ("2.5", "97.5")


@dataclasses.dataclass(frozen=True, eq=False)
class Tracked:
    """The contents of a results folder.

    Attributes:
        target: boxes, parts, points or contours.
        names: ``[P]``.
        lines: ``[T, P, S, 2]``, corners, outlines or points, pixels; NaN where missing.
        confidence: ``[T, P]``, confidence in the reported position; 0 where an object is lost.
        intervals: ``[T, P, 2, 2]``, 2.5 and 97.5 % quantiles of x and y of the centre; None if the
            folder has none.
        video: the tracked video.
        size: width and height of its frames.
        fps: its frames per second.
        times: ``[T]``, timestamp of each frame, seconds from the first.
    """

    target: str
    names: tuple[str, ...]
    lines: np.ndarray
    confidence: np.ndarray
    intervals: np.ndarray | None
    video: str
    size: tuple[int, int]
    fps: float
    times: np.ndarray

    @property
    def ids(self) -> list[int]:
        """``[P]``: the names if they are different whole numbers, else 1, 2, ..., P."""
        if all(name.removeprefix("-").isdecimal() for name in self.names):
            ids = [int(name) for name in self.names]
            if len(set(ids)) == len(ids):
                return ids
        return list(range(1, len(self.names) + 1))

    @property
    def boxes(self) -> np.ndarray:
        """``[T, P, 4]``, bounding boxes x, y, w, h of the lines."""
        low, high = self.lines.min(axis=2), self.lines.max(axis=2)
        return np.concatenate([low, high - low], axis=-1)

    @property
    def there(self) -> np.ndarray:
        """``[K, 2]``: frame and object of every reported position."""
        return np.argwhere(np.isfinite(self.lines).all(axis=(2, 3)))


def read_tracked(folder: Path) -> Tracked:
    """Read the results of ``jaxpf track``.

    Raises:
        InputError: a file is missing or invalid, or the video no longer exists.
    """
    text = read_text(folder / "summary.json", "results", "a folder that `jaxpf track` wrote")
    try:
        about = json.loads(text)["parameters"]
        target, video = str(about["target"]), str(about["video"])
    except (json.JSONDecodeError, KeyError, TypeError, RecursionError):
        raise InputError(
            f"'{folder / 'summary.json'}' is no summary of `jaxpf track`; give its output folder."
        ) from None
    if not len(read_tracks(folder / "tracks.csv")["frame"]):
        raise InputError(f"'{folder / 'tracks.csv'}' holds no tracks, so nothing can be exported.")
    names, lines, confidence = (_read_boxes if target == "boxes" else _read_lines)(folder)
    source = open_frames(video)
    return Tracked(
        target,
        names,
        lines,
        confidence,
        _read_intervals(folder / "tracks.csv", names, len(lines), target == "boxes"),
        str(video),
        (source.width, source.height),
        source.fps,
        source.times(len(lines)),
    )


def _read_boxes(folder: Path) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    table = read_boxes(folder / "tracks.csv")
    ids = sorted(set(table.id.tolist()))
    boxes = dense(table, ids, int(table.frame.max()) + 1)
    confidence = np.zeros(boxes.shape[:2])
    confidence[table.frame, np.searchsorted(ids, table.id)] = table.confidence
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    lines = boxes[:, :, None, :2] + corners * boxes[:, :, None, 2:]
    return tuple(map(str, ids)), lines, confidence


def _read_lines(folder: Path) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Read tracks of parts, points or contours."""
    table = read_tracks(folder / "tracks.csv")
    ids = [str(name) for name in table["id"].tolist()]
    names = tuple(dict.fromkeys(ids))
    rows = table["frame"], np.array([names.index(name) for name in ids], int)
    num_frames = int(table["frame"].max(initial=-1)) + 1
    confidence = np.zeros((num_frames, len(names)))
    confidence[rows] = (1 - table["lost"]) * np.nan_to_num(table.get("confidence", 1.0), nan=1.0)
    path = folder / "outlines.csv"
    if path.is_file():
        return names, _read_outlines(path, names, num_frames), confidence
    places = np.stack([table["x"], table["y"]], axis=-1)[:, None]
    if "angle" in table:
        places = _corners(table)
    lines = np.full((num_frames, len(names), *places.shape[1:]), np.nan)
    lines[rows] = places
    return names, lines, confidence


def _read_outlines(path: Path, names: tuple[str, ...], num_frames: int) -> np.ndarray:
    rows = [row for row in _rows(path) if row["kind"] == "outline"]
    try:
        length = 1 + max(int(row["point"]) for row in rows)
        lines = np.full((num_frames, len(names), length, 2), np.nan)
        for row in rows:
            place = float(row["x"]), float(row["y"])
            lines[int(row["frame"]), names.index(row["contour"]), int(row["point"])] = place
    except (ValueError, TypeError, IndexError):
        raise InputError(
            f"'{path}' is damaged, or not of the tracks beside it; track again."
        ) from None
    return lines


def _corners(table: dict[str, np.ndarray]) -> np.ndarray:
    """Corners ``[K, 4, 2]`` of rotated rectangles."""
    angle = np.deg2rad(table["angle"])
    turn = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=-1)
    half = np.stack([table["w"], table["h"]], axis=-1)[:, None] / 2
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    return np.stack([table["x"], table["y"]], -1)[:, None] + corners @ turn.reshape(-1, 2, 2)


def _read_intervals(
    path: Path, names: tuple[str, ...], num_frames: int, are_boxes: bool
) -> np.ndarray | None:
    """Intervals of the centre; a box's centre is half its size from the corner in the file."""
    table = read_tracks(path)
    if "x_2.5" not in table:
        return None
    intervals = np.full((num_frames, len(names), 2, len(_INTERVAL)), np.nan)
    columns = [names.index(str(name)) for name in table["id"].tolist()]
    for axis, (place, size) in enumerate((("x", "w"), ("y", "h"))):
        half = table[size] / 2 if are_boxes else 0.0
        for end, level in enumerate(_INTERVAL):
            intervals[table["frame"], columns, axis, end] = table[f"{place}_{level}"] + half
    return intervals


def _rows(path: Path) -> list[dict[str, str]]:
    with report_os_errors("read", path), path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise InputError(f"'{path}' holds no tracks.")
    return rows


def write_coco(path: Path, tracked: Tracked) -> None:
    """Write COCO JSON: an image per frame; boxes, polygons, or a skeleton of all points.

    ``track_id``, ``score`` (the confidence) and ``time`` (of an image, in seconds) extend COCO's
    keys, as is usual for tracks.
    """
    width, height = tracked.size
    name = Path(tracked.video).stem
    of_points = tracked.target == "points"
    category: dict[str, Any] = {"id": 1, "name": _LABEL}
    if of_points:
        category |= {"keypoints": list(tracked.names), "skeleton": []}
    annotations = list((_skeletons if of_points else _shapes)(tracked))
    content = {
        "images": [
            {
                "id": t + 1,
                "file_name": f"{name}_{t:06d}.png",
                "width": width,
                "height": height,
                "time": round(float(time), 6),
            }
            for t, time in enumerate(tracked.times)
        ],
        "annotations": [
            {"id": number, "category_id": 1, "iscrowd": 0, **annotation}
            for number, annotation in enumerate(annotations, start=1)
        ],
        "categories": [category],
    }
    write_text(path, json.dumps(content))


def _shapes(tracked: Tracked) -> Any:
    boxes = tracked.boxes
    for t, p in tracked.there:
        line = tracked.lines[t, p]
        # An open contour is not a polygon.
        closed = tracked.target != "contours" or np.allclose(line[0], line[-1], atol=0.01)
        x, y = line.T
        area = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
        yield {
            "image_id": int(t) + 1,
            "track_id": tracked.ids[p],
            "bbox": _rounded(boxes[t, p]),
            "area": round(float(area if closed else boxes[t, p, 2:].prod()), 3),
            "segmentation": [_rounded(line.ravel())] if closed else [],
            "score": round(float(tracked.confidence[t, p]), 4),
        }


def _skeletons(tracked: Tracked) -> Any:
    for t, points in enumerate(tracked.lines[:, :, 0]):
        there = np.isfinite(points).all(axis=1)
        if not there.any():
            continue
        low, high = points[there].min(axis=0), points[there].max(axis=0)
        # COCO: 0 not labelled, 1 labelled and not visible, 2 visible.
        seen = np.where(there, 1 + (tracked.confidence[t] > 0), 0)
        marks = np.column_stack([np.where(there[:, None], points, 0), seen])
        yield {
            "image_id": t + 1,
            "track_id": 1,
            "bbox": _rounded([*low, *(high - low)]),
            "area": round(float((high - low).prod()), 3),
            "keypoints": _rounded(marks.ravel()),
            "num_keypoints": int(there.sum()),
        }


def write_cvat(path: Path, tracked: Tracked) -> None:
    """Write CVAT's "MOT 1.1" archive.

    Raises:
        InputError: the target is points, which have no box, or the file cannot be written.
    """
    if tracked.target == "points":
        raise InputError("CVAT's MOT archive holds boxes, and points have none; choose coco.")
    boxes = tracked.boxes
    lines = (
        ",".join([str(t + 1), str(tracked.ids[p]), *map(str, _rounded(boxes[t, p])), "1,1,1"])
        for t, p in tracked.there
    )
    with atomic_write(path, "wb") as file, zipfile.ZipFile(file, "w") as archive:
        archive.writestr("gt/gt.txt", "\n".join(lines) + "\n")
        archive.writestr("gt/labels.txt", f"{_LABEL}\n")


def write_motchallenge(path: Path, tracked: Tracked) -> None:
    """Write MOT lines ``frame,id,x,y,w,h,confidence,-1,-1,-1``; frames and x, y count from 1.

    Raises:
        InputError: the target is points, which have no box, or the file cannot be written.
    """
    if tracked.target == "points":
        raise InputError("MOT files hold boxes, and points have none; choose coco.")
    frames, objects = tracked.there.T
    ids = np.array(tracked.ids)[objects]
    boxes, confidence = tracked.boxes[frames, objects], tracked.confidence[frames, objects]
    write_mot(path, frames, ids, boxes, confidence)


def write_movement(path: Path, tracked: Tracked) -> None:
    """Write netCDF in ``movement``'s layout: poses for points, bounding boxes for other targets.

    ``position``, ``shape`` (of boxes) and ``confidence`` follow ``movement``.  We add ``interval``
    ``[time, space, level, ...]``, quantiles of the position, in percent of the particles.

    Raises:
        InputError: xarray is missing, or the file cannot be written.
    """
    try:
        import xarray
    except ModuleNotFoundError:
        raise InputError(
            "movement's files need xarray, which is missing; pip install 'jaxpf[formats]'."
        ) from None

    def turned(values: np.ndarray) -> np.ndarray:  # [T, P, ...] -> [T, ..., P]
        moved = np.moveaxis(values, 1, -1)
        return moved[..., None] if of_points else moved

    of_points = tracked.target == "points"
    boxes = tracked.boxes
    whose = ["keypoints", "individuals"] if of_points else ["individuals"]
    values = {
        "position": (["time", "space", *whose], turned(boxes[..., :2] + boxes[..., 2:] / 2)),
        "confidence": (["time", *whose], turned(tracked.confidence)),
    }
    coordinates: dict[str, Any] = {
        "time": tracked.times,
        "space": ["x", "y"],
        "individuals": ["object"] if of_points else [f"id_{name}" for name in tracked.names],
    }
    if of_points:
        coordinates["keypoints"] = list(tracked.names)
    else:
        values["shape"] = (["time", "space", *whose], turned(boxes[..., 2:]))
    if tracked.intervals is not None:
        values["interval"] = (["time", "space", "level", *whose], turned(tracked.intervals))
        coordinates["level"] = [float(level) for level in _INTERVAL]
    about = {
        "ds_type": "poses" if of_points else "bboxes",
        "source_software": "jaxpf",
        "source_file": str(tracked.video),
        "fps": tracked.fps,
        "time_unit": "seconds",
    }
    with atomic_path(path) as temporary:
        xarray.Dataset(values, coordinates, about).to_netcdf(temporary, engine="scipy")


def _rounded(values: Any) -> list[float]:
    return [round(float(value), 3) for value in values]


#: Format -> file-name suffix and writer.
FORMATS: dict[str, tuple[str, Callable[[Path, Tracked], None]]] = {
    "coco": (".json", write_coco),
    "cvat": (".zip", write_cvat),
    "mot": (".txt", write_motchallenge),
    "movement": (".nc", write_movement),
}
