"""Reads sequence folders of the MOTChallenge and OTB benchmarks as clips.

Both count frames and pixels from 1; clips count from 0, so 1 is subtracted from x, y and the frame
numbers, and from nothing else.  No picture is decoded except OTB's first, for its size.
"""

import configparser
import math
import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from scenes.clips import NOT_ANNOTATED, Clip, Rows, real_number, tabulated, text_of, whole_number
from scenes.scene import SceneError, shown

_PICTURES = {".jpg", ".jpeg", ".png", ".bmp"}
_PEDESTRIAN = 1

# The benchmark starts David at picture 300, though its folder contains all 770; every other
# sequence starts at its first picture.
_OTB_FIRST_PICTURE = {"david": 300}
_OTB_FPS = 25.0  # nominal: the benchmark specifies none
#: The numbers of seqinfo.ini and their upper limits.
_MOST = {"seqLength": 10**6, "imWidth": 10**5, "imHeight": 10**5, "frameRate": 10**6}


def read_mot(folder: str | Path) -> Clip:
    """Open a MOTChallenge sequence: ``seqinfo.ini``, ``gt/gt.txt`` and the pictures.

    Rows of ``gt.txt`` are ``frame,id,x,y,w,h,confidence,...``.  As in the benchmark's evaluation
    (Milan et al. 2016, MOT16), rows with confidence 0 are ignored, and with 8 or 9 columns
    (MOT16 and later: class, visibility) only class 1, pedestrians, counts.  With 10 columns
    (MOT15: world coordinates), or with class -1, there are no classes.  The visibility v becomes
    ``occlusion``: 0 if v = 1, 1 if v is at least half, 2 below.

    Args:
        folder: the sequence's, such as ``MOT17/train/MOT17-02-FRCNN``.

    Returns:
        The clip; its ids are those of the file.

    Raises:
        SceneError: a missing file or picture, or a malformed description or line; the message
            names it.
    """
    folder = Path(folder)
    info = _read_seqinfo(folder / "seqinfo.ini")
    num_frames = info["seqLength"]
    source, numbers = _find_pictures(folder, info["imDir"])
    missing = sorted(set(range(1, num_frames + 1)) - set(numbers))
    if missing:
        raise SceneError(
            f"{folder / (source % missing[0])} is missing: seqinfo.ini says seqLength = "
            f"{num_frames}"
        )
    rows = _read_mot_truth(folder / "gt" / "gt.txt", num_frames)
    ids, boxes, occlusion = tabulated(rows, num_frames)
    return Clip(
        name=info["name"],
        folder=folder,
        source=source,
        num_frames=num_frames,
        width=info["imWidth"],
        height=info["imHeight"],
        fps=info["frameRate"],
        ids=ids,
        boxes=boxes,
        occlusion=occlusion,
        first_number=1,
        description="seqinfo.ini",
    )


def read_otb(folder: str | Path) -> Clip:
    """Open a sequence of the Visual Tracker Benchmark (Wu, Lim and Yang 2013, 2015).

    ``img/`` contains the pictures and ``groundtruth_rect.txt`` one line ``x,y,w,h`` per picture,
    separated by commas, tabs or spaces.  A line of zeros or NaN marks an absent object.  The
    object's id is 1; ``groundtruth_rect.1.txt``, ``groundtruth_rect.2.txt``, ... contain the
    objects 1, 2, ... of one sequence (Jogging, Skating2).  The first line belongs to the first
    picture, whatever its number (BlurCar1 starts at 247); pictures after the last line are ignored
    (Football1); of David, the benchmark uses pictures 300 to 770.  The benchmark specifies no
    frame rate; ``fps`` is 25.

    Raises:
        SceneError: a missing file or picture, or a malformed line; the message names it.
    """
    folder = Path(folder)
    source, numbers = _find_pictures(folder, "img")
    truth = _find_otb_truth(folder)
    columns = {number: _read_otb_truth(path) for number, path in truth.items()}
    lengths = {len(rows) for rows in columns.values()}
    if len(lengths) > 1:
        raise SceneError(
            f"{folder}: its files groundtruth_rect.*.txt have different numbers of lines, "
            f"{' and '.join(map(str, sorted(lengths)))}"
        )
    num_frames = lengths.pop()
    first = numbers[0]
    if len(numbers) > num_frames:
        first = _OTB_FIRST_PICTURE.get(folder.resolve().name.lower(), first)
    available = set(numbers)
    for frame in range(num_frames):
        if first + frame not in available:
            raise SceneError(
                f"{folder / (source % (first + frame))} is missing: "
                f"{next(iter(truth.values())).name} has {num_frames} lines, one per picture"
            )
    picture = cv2.imread(str(folder / (source % first)), cv2.IMREAD_COLOR)
    if picture is None:
        raise SceneError(f"{folder / (source % first)} is not a picture")
    boxes = np.stack(list(columns.values()), axis=1)
    return Clip(
        name=folder.resolve().name,
        folder=folder,
        source=source,
        num_frames=num_frames,
        width=picture.shape[1],
        height=picture.shape[0],
        fps=_OTB_FPS,
        ids=tuple(columns),
        boxes=boxes,
        occlusion=np.full(boxes.shape[:2], NOT_ANNOTATED),
        first_number=first,
        description="its first picture",
    )


def _find_pictures(folder: Path, name: str) -> tuple[str, list[int]]:
    """Return the pattern of the numbered pictures in a folder, and their numbers, ascending."""
    numbered = {
        path: int(path.stem)
        for path in (folder / name).glob("*")
        if path.stem.isdecimal() and path.suffix.lower() in _PICTURES
    }
    if not numbered:
        raise SceneError(
            f"{folder / name} holds no numbered pictures such as 0001.jpg; "
            "put the sequence's frames there"
        )
    first = min(numbered, key=lambda path: numbered[path])
    pattern = f"{name.replace('%', '%%')}/%0{len(first.stem)}d{first.suffix}"
    return pattern, sorted(numbered.values())


def _read_seqinfo(path: Path) -> dict:
    if not path.is_file():
        raise SceneError(
            f"{path} is missing: a MOTChallenge sequence needs seqinfo.ini, gt/gt.txt and img1/"
        )
    parser = configparser.ConfigParser(interpolation=None)
    description = text_of(path)
    try:
        parser.read_string(description)
        section = parser["Sequence"]
    except (configparser.Error, KeyError) as error:
        cause = " ".join(str(error)[:200].split())
        raise SceneError(
            f"{path} is no MOTChallenge description with a section [Sequence]: {cause}"
        ) from None
    values: dict = {
        "name": section.get("name", path.resolve().parent.name),
        "imDir": section.get("imDir", "img1"),
    }
    for key, most in _MOST.items():
        text = section.get(key)
        if text is None:
            raise SceneError(f"{path} has no line {key}=...; add it")
        read = real_number if key == "frameRate" else whole_number
        values[key] = read(text, key, str(path))
        if values[key] <= 0:
            raise SceneError(f"{path}: {key} = {shown(text)} must be above 0")
        if values[key] > most:
            raise SceneError(f"{path}: {key} = {shown(text)} must be at most {most}")
    return values


def _read_mot_truth(path: Path, num_frames: int) -> Rows:
    """Read the rows that the evaluation counts."""
    if not path.is_file():
        raise SceneError(
            f"{path} is missing: a sequence without truth, such as the benchmark's test "
            "sequences, cannot be evaluated; give a training sequence"
        )
    rows: Rows = {}
    for place, cells in _lines(path, r"\s*[,;]\s*"):
        if not 6 <= len(cells) <= 10:
            raise SceneError(f"{place} has {len(cells)} values, not 6 to 10: frame,id,x,y,w,h,...")
        frame, number = (
            whole_number(cell, column, place)
            for cell, column in zip(cells, ("frame", "id"), strict=False)
        )
        x, y, w, h, *rest = (
            real_number(cell, f"column {index}", place)
            for index, cell in enumerate(cells[2:], start=3)
        )
        has_classes = len(cells) in (8, 9)
        if not 1 <= frame <= num_frames:
            raise SceneError(f"{place}: frame must lie in 1..{num_frames}, counting from 1")
        if rest and rest[0] == 0:
            continue
        if has_classes and rest[1] not in (_PEDESTRIAN, -1):
            continue
        if w <= 0 or h <= 0:
            raise SceneError(f"{place}: w and h must be above 0")
        key = (frame - 1, number)
        if key in rows:
            raise SceneError(f"{place}: a second box for object {number} in frame {frame}")
        rows[key] = ([x - 1, y - 1, w, h], _occlusion(rest[2] if len(cells) == 9 else -1))
    if not rows:
        raise SceneError(
            f"{path} holds no row that counts: confidence other than 0 and class 1, a pedestrian"
        )
    return rows


def _occlusion(visibility: float) -> int:
    if not 0 <= visibility <= 1:
        return NOT_ANNOTATED
    if visibility == 1:
        return 0
    return 1 if visibility >= 0.5 else 2


def _find_otb_truth(folder: Path) -> dict[int, Path]:
    """Return id -> file, ascending."""
    single = folder / "groundtruth_rect.txt"
    if single.is_file():
        return {1: single}
    numbered = {}
    for path in folder.glob("groundtruth_rect.*.txt"):
        middle = path.name.split(".")[1]
        if middle.isdecimal():
            numbered[int(middle)] = path
    if not numbered:
        raise SceneError(f"{single} is missing: an OTB sequence needs img/ and its boxes")
    return dict(sorted(numbered.items()))


def _read_otb_truth(path: Path) -> np.ndarray:
    """Read boxes ``[T, 4]``, counting from 0; NaN where the object is absent."""
    boxes = []
    for place, cells in _lines(path, r"[,;\s]+"):
        if len(cells) != 4:
            raise SceneError(f"{place} has {len(cells)} values, not 4: x,y,w,h")
        if all(cell.lower() == "nan" for cell in cells):
            cells = ["0"] * 4
        x, y, w, h = (
            real_number(cell, column, place) for cell, column in zip(cells, "xywh", strict=True)
        )
        if w == 0 and h == 0:
            boxes.append([math.nan] * 4)
        elif w <= 0 or h <= 0:
            raise SceneError(f"{place}: w and h must be above 0, or all four 0 for absent")
        else:
            boxes.append([x - 1, y - 1, w, h])
    if np.isnan(boxes).all():
        raise SceneError(f"{path} holds no box")
    return np.array(boxes)


def _lines(path: Path, separator: str) -> Iterator[tuple[str, list[str]]]:
    """Yield (place for messages, cells) of every non-empty line."""
    for number, line in enumerate(text_of(path).splitlines(), start=1):
        line = line.strip()
        if line:
            yield f"{path}, line {number}: {shown(line)}", re.split(separator, line)
