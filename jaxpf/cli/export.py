"""``jaxpf export``: tracks in the formats of COCO, CVAT, MOT, DeepLabCut and SLEAP.

All read the output folder of ``jaxpf track``, without the video, and keep the objects' ids.  In
memory, frames and pixels count from 0, and pixel (0, 0) is the square [0, 1) x [0, 1).  File
conventions:

==============  ===========  ===========  =================================
format          first frame  first pixel  position
==============  ===========  ===========  =================================
mot             1            1            top left corner, width and height
coco            image id 1   0            top left corner, width and height
cvat (MOT 1.1)  1            0            top left corner, width and height
dlc, sleap      0            0            keypoints
==============  ===========  ===========  =================================

COCO's times are frame timestamps, which differ from index / fps where the frame rate varies.
"""

import dataclasses
import json
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd

from jaxpf.boxes.tracks import read_tracks, write_mot
from jaxpf.cli.shared import flags
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import Command, GivenPath
from jaxpf.contract.errors import InputError
from jaxpf.files.reading import read_text
from jaxpf.files.writing import SUMMARY, atomic_write, check_output_file, write_text

#: Category of all tracked objects.
_LABEL = "object"


@dataclasses.dataclass(frozen=True, eq=False)
class Tracked:
    """The contents of a results folder.

    Attributes:
        target: boxes, parts, points or contours.
        names: ``[P]``.
        first: number of the first of T frames, from 0.
        times: ``[T]``, timestamp of each frame, seconds.
        pictures: ``[T]``, file name of each frame; those of a film are made up.
        lines: ``[T, P, S, 2]``, corners, outlines or points, pixels; NaN where missing.
        confidence: ``[T, P]``, confidence in the reported position; where the tracks have none,
            0 where an object is lost and else 1.
        lost: bool ``[T, P]``.
        size: width and height of the frames.
    """

    target: str
    names: tuple[str, ...]
    first: int
    times: np.ndarray
    pictures: tuple[str, ...]
    lines: np.ndarray
    confidence: np.ndarray
    lost: np.ndarray
    size: tuple[int, int]

    @property
    def ids(self) -> list[int]:
        """``[P]``: the names if they are different exact whole numbers, else 1, 2, ..., P."""
        if all(name.removeprefix("-").isdecimal() and len(name) < 16 for name in self.names):
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
    def places(self) -> np.ndarray:
        """``[K, 2]``: index of the frame and of the object of every reported position."""
        return np.argwhere(np.isfinite(self.lines).all(axis=(2, 3)))


def read_tracked(folder: Path) -> Tracked:
    """Read the results of ``jaxpf track``."""
    text = read_text(folder / SUMMARY, "results", "a folder that `jaxpf track` wrote")
    try:
        summary = json.loads(text)
        parameters = summary["parameters"]
        target, video = str(parameters["target"]), str(parameters["video"])
        times, first = np.array(summary["times"], float), int(parameters["start"])
        size = int(summary["width"]), int(summary["height"])
        made_up = [f"{Path(video).stem}_{first + number:06d}.png" for number in range(len(times))]
        pictures = tuple(map(str, summary["pictures"] or made_up))
        if times.shape != (len(pictures),):
            raise ValueError
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(
            f"'{folder / SUMMARY}' is not a summary of this version of `jaxpf track`; give its "
            "output folder, or track again."
        ) from None
    tracks, outlines = folder / "tracks.csv", folder / "outlines.csv"
    table = read_tracks(tracks)
    if not len(table["frame"]):
        raise InputError(f"'{tracks}' holds no tracks, so nothing can be exported.")
    at, ids = table["frame"] - first, [str(name) for name in table["id"].tolist()]
    if not np.isin(at, np.arange(len(times))).all():
        raise InputError(
            f"'{folder / SUMMARY}' and 'tracks.csv' are of different runs, whose frames differ; "
            "track again."
        )
    names = tuple(dict.fromkeys(ids))
    shape, rows = (len(times), len(names)), (at, [names.index(name) for name in ids])
    confidence, lost = np.zeros((2, *shape))
    try:
        lost[rows], reported = table["lost"], table.get("confidence", np.nan)
        confidence[rows] = np.where(np.isnan(reported), 1 - table["lost"], reported)
        if outlines.is_file():
            lines = _read_outlines(outlines, names, first, shape)
        else:
            corners = _lines_of(table, target)
            lines = np.full((*shape, *corners.shape[1:]), np.nan)
            lines[rows] = corners
    except KeyError as error:
        raise InputError(
            f"'{tracks}' has no column {error}, which tracks of {target} have; track again."
        ) from None
    return Tracked(target, names, first, times, pictures, lines, confidence, lost > 0, size)


def _lines_of(table: dict[str, np.ndarray], target: str) -> np.ndarray:
    """Points ``[K, 1, 2]`` or corners ``[K, 4, 2]`` of the rows of tracks.csv."""
    places = np.stack([table["x"], table["y"]], axis=-1)[:, None]
    if "w" not in table:
        return places
    sizes = np.stack([table["w"], table["h"]], axis=-1)[:, None]
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    if target == "boxes":
        return places + corners * sizes
    angle = np.deg2rad(table["angle"])
    turn = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=-1)
    return places + (corners - 0.5) * sizes @ turn.reshape(-1, 2, 2)


def _read_outlines(
    path: Path, names: tuple[str, ...], first: int, shape: tuple[int, int]
) -> np.ndarray:
    try:
        table = pd.read_csv(path, dtype={"id": str}, keep_default_na=False)
        table = table[table["kind"] == "outline"]
        lines = np.full((*shape, 1 + max(table["k"]), 2), np.nan)
        place = table["frame"] - first, [names.index(name) for name in table["id"]], table["k"]
        lines[place] = table[["x", "y"]]
    except (ValueError, IndexError, KeyError, TypeError):
        raise InputError(
            f"'{path}' is damaged, or does not belong to the tracks beside it; track again."
        ) from None
    return lines


def write_coco(path: Path, tracked: Tracked) -> None:
    """Write COCO JSON: an image per frame; boxes, polygons, or a skeleton of all points.

    ``track_id``, ``score`` (the confidence) and ``time`` (of an image, in seconds) extend COCO's
    keys, as is usual for tracks.
    """
    width, height = tracked.size
    of_points = tracked.target == "points"
    category: dict[str, Any] = {"id": 1, "name": _LABEL}
    if of_points:
        category |= {"keypoints": list(tracked.names), "skeleton": []}
    images = [
        {
            "id": number,
            "file_name": name,
            "width": width,
            "height": height,
            "time": round(float(time), 6),
        }
        for number, (name, time) in enumerate(
            zip(tracked.pictures, tracked.times, strict=True), start=tracked.first + 1
        )
    ]
    annotations = [
        {"id": number, "category_id": 1, "iscrowd": 0, **annotation}
        for number, annotation in enumerate((_skeletons if of_points else _shapes)(tracked), 1)
    ]
    content = {"images": images, "annotations": annotations, "categories": [category]}
    write_text(path, json.dumps(content))


def _shapes(tracked: Tracked) -> Iterator[dict[str, Any]]:
    boxes = tracked.boxes
    for t, p in tracked.places:
        line = tracked.lines[t, p]
        # An open contour is not a polygon.
        closed = tracked.target != "contours" or np.allclose(line[0], line[-1], atol=0.01)
        x, y = line.T
        area = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
        yield {
            "image_id": int(t) + tracked.first + 1,
            "track_id": tracked.ids[p],
            "bbox": _rounded(boxes[t, p]),
            "area": round(float(area if closed else boxes[t, p, 2:].prod()), 3),
            "segmentation": [_rounded(line.ravel())] if closed else [],
            "score": round(float(tracked.confidence[t, p]), 4),
        }


def _skeletons(tracked: Tracked) -> Iterator[dict[str, Any]]:
    for t, points in enumerate(tracked.lines[:, :, 0]):
        reported = np.isfinite(points).all(axis=1)
        if not reported.any():
            continue
        low, high = points[reported].min(axis=0), points[reported].max(axis=0)
        # COCO: 0 not labelled, 1 labelled and not visible, 2 visible.
        seen = np.where(reported, 2 - tracked.lost[t], 0)
        marks = np.column_stack([np.where(reported[:, None], points, 0), seen])
        yield {
            "image_id": t + tracked.first + 1,
            "track_id": 1,
            "bbox": _rounded([*low, *(high - low)]),
            "area": round(float((high - low).prod()), 3),
            "keypoints": _rounded(marks.ravel()),
            "num_keypoints": int(reported.sum()),
        }


def write_cvat(path: Path, tracked: Tracked) -> None:
    """Write CVAT's "MOT 1.1" archive."""
    boxes = tracked.boxes
    lines = (
        ",".join(map(str, [t + tracked.first + 1, tracked.ids[p], *_rounded(boxes[t, p]), 1, 1, 1]))
        for t, p in tracked.places
    )
    with atomic_write(path, "wb") as file, zipfile.ZipFile(file, "w") as archive:
        archive.writestr("gt/gt.txt", "\n".join(lines) + "\n")
        archive.writestr("gt/labels.txt", f"{_LABEL}\n")


def write_motchallenge(path: Path, tracked: Tracked) -> None:
    """Write MOT lines ``frame,id,x,y,w,h,confidence,-1,-1,-1``; frames and x, y count from 1."""
    times, objects = tracked.places.T
    ids = np.array(tracked.ids)[objects]
    boxes, confidence = tracked.boxes[times, objects], tracked.confidence[times, objects]
    write_mot(path, times + tracked.first, ids, boxes, confidence)


def write_deeplabcut(path: Path, tracked: Tracked) -> None:
    """Write the CSV table of predictions of one animal as DeepLabCut writes it."""
    levels = ["jaxpf"], tracked.names, ("x", "y", "likelihood")
    table = _keypoints(tracked)
    table.columns = pd.MultiIndex.from_product(levels, names=("scorer", "bodyparts", "coords"))
    write_text(path, table.to_csv(lineterminator="\n"))


def write_sleap(path: Path, tracked: Tracked) -> None:
    """Write the CSV table of SLEAP's "Export Analysis CSV", with one instance."""
    table = _keypoints(tracked)
    table.columns = [f"{name}.{what}" for name in tracked.names for what in ("x", "y", "score")]
    table.insert(0, "instance.score", tracked.confidence.mean(axis=1).round(4))
    table.insert(0, "frame_idx", table.index)
    table.insert(0, "track", "jaxpf")
    write_text(path, table.to_csv(index=False, lineterminator="\n"))


def _keypoints(tracked: Tracked) -> pd.DataFrame:
    """x, y and confidence of each point, a row per frame; empty where not reported."""
    values = np.concatenate([tracked.lines[:, :, 0], tracked.confidence[..., None]], axis=-1)
    values[~np.isfinite(values).all(axis=-1)] = np.nan
    table = pd.DataFrame(values.reshape(len(values), -1))
    return table.map(lambda value: round(value, 4)).set_axis(table.index + tracked.first)


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), 3) for value in values]


#: Format -> file-name suffix, writer, and whether it holds keypoints alone (True), boxes alone
#: (False), or both (None).
_FORMATS: dict[str, tuple[str, Callable[[Path, Tracked], None], bool | None]] = {
    "coco": (".json", write_coco, None),
    "cvat": (".zip", write_cvat, False),
    "mot": (".txt", write_motchallenge, False),
    "dlc": (".csv", write_deeplabcut, True),
    "sleap": (".csv", write_sleap, True),
}


@click.command("export", cls=Command)
@click.argument("folder", type=GivenPath())
@click.argument("form", metavar="FORMAT", type=click.Choice(list(_FORMATS)))
@click.argument("output", metavar="FILE", type=GivenPath())
@flags.overwrite_file
def command(folder: Path, form: str, output: Path, overwrite: bool) -> None:
    """Write the tracks of `jaxpf track` in FOLDER to FILE, in FORMAT.

    coco: JSON with boxes, polygons or keypoints.  cvat: the archive that CVAT imports as "MOT
    1.1".  mot: text lines of the MOTChallenge, which count from 1.  dlc: keypoints as DeepLabCut's
    table of predictions.  sleap: keypoints as SLEAP's analysis CSV.

    Example: jaxpf export jaxpf-clip coco tracks.json
    """
    suffix, write, of_points = _FORMATS[form]
    if output.suffix != suffix:
        raise InputError(f"output '{output}' must end in {suffix}; rename it.")
    check_output_file(output, "FILE", overwrite)
    tracked = read_tracked(folder)
    if of_points not in (None, tracked.target == "points"):
        holds, others = ("keypoints", "cvat or mot") if of_points else ("boxes", "dlc or sleap")
        raise InputError(
            f"{form} files hold only {holds}, and these are tracks of {tracked.target}; choose "
            f"coco, {others}."
        )
    write(output, tracked)
    count, frames = len(tracked.names), len(tracked.times)
    say(f"{output}: {count} {tracked.target} in {frames} frames")
