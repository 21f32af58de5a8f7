"""Opens recorded sequences: a reader for each layout of folders.

To add a layout, write a function of the folder that returns a ``Sequence``, and recognise the
folder in ``layout_of``.
"""

import configparser
import math
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.files.reading import LARGEST_WHOLE, parse_number, read_below, read_json, read_text
from jaxpf.media.images import frame_numbers, pictures_in, read_mask
from jaxpf.sequences.frames import Frames
from jaxpf.sequences.sequence import Sequence
from jaxpf.sequences.tables import BoxTable, read_boxes, table_of

_FORMATS = (
    "meta.json with gt.csv or points.csv, seqinfo.ini with gt/gt.txt (MOTChallenge), "
    "groundtruth_rect.txt (OTB), groundtruth.txt (LaSOT, GOT-10k, VOT), or label images in masks/, "
    "or as in DAVIS, VisDrone or the Cell Tracking Challenge"
)
# The benchmark starts David at picture 300, though its folder contains all 770; every other
# sequence of OTB starts at its first picture.
_OTB_FIRST_PICTURE = {"david": 300}
#: Limits of the numbers of a description; see ``_described``.
_LIMITS: tuple[dict[str, Any], ...] = (
    {"least": 1, "most": 10**6, "whole": True},
    *[{"least": 1, "most": 10**5, "whole": True}] * 2,
    {"least": 1e-3, "most": 10**6},
)
_WHOLE: dict[str, Any] = {"least": 0, "most": LARGEST_WHOLE, "whole": True}
#: Header of annotated points; "visible" may follow.
_POINTS = "frame,id,cx,cy"
#: Side of the window around an annotated point that stands for its box, pixels.
_WINDOW = 16.0


def open_sequence(path: str | os.PathLike[str]) -> Sequence:
    """Open the folder of a recorded sequence with its annotation; decodes the first frame only.

    The files in it, or beside it, determine its layout:

    * ``meta.json``: ``frames`` (a video, or a pattern such as ``frames/%04d.png`` counted from 0),
      ``n_frames``, ``width``, ``height`` and ``fps``; truth in ``gt.csv``
      (``jaxpf.boxes.read_boxes``), or for points in ``points.csv``, ``frame,id,cx,cy`` and
      optionally ``visible``.
    * MOTChallenge: ``seqinfo.ini``, ``gt/gt.txt`` and pictures numbered from 1.
    * OTB: ``img/`` and ``groundtruth_rect.txt``, or ``.1.txt``, ``.2.txt`` for several objects.
      Lines belong to the pictures in order, a blank one to a picture without the object; pictures
      after the last line are left out.
    * LaSOT, GOT-10k and VOT: ``groundtruth.txt``; LaSOT's ``out_of_view.txt`` and GOT-10k's
      ``absence.label`` mark absences, and of VOT's quadrangles the upright boxes around them count.
    * VisDrone: ``sequences/NAME`` with ``annotations/NAME.txt``.
    * Label images: ``masks/`` in the folder; ``JPEGImages/.../NAME`` with ``Annotations/.../NAME``
      (DAVIS); ``NAME`` with ``NAME_GT/TRA`` (Cell Tracking Challenge).  Boxes surround the pixels
      of each number.

    Raises:
        InputError: no such folder, an unknown layout, or a damaged file.
    """
    folder = Path(path)
    if not folder.is_dir():
        kind = "is a file, not a folder" if folder.exists() else "does not exist"
        raise InputError(f"'{folder}' {kind}; give the folder of a sequence")
    read, truth = layout_of(folder)
    if read is None:
        raise InputError(f"'{folder}' is not a sequence in a known layout; it must hold {_FORMATS}")
    return read(folder, truth)


def sequences_in(path: str | os.PathLike[str]) -> list[Path]:
    """Return the sequences in a folder, by name; none if the folder itself is a sequence."""
    folder = Path(path)
    if not folder.is_dir() or layout_of(folder)[0]:
        return []
    return [each for each in sorted(folder.iterdir()) if each.is_dir() and layout_of(each)[0]]


def read_truth(path: str | os.PathLike[str]) -> BoxTable:
    """Read the true boxes of a file, see ``jaxpf.boxes.read_boxes``, or of a sequence's folder."""
    return open_sequence(path).truth if Path(path).is_dir() else read_boxes(path, truth=True)


def layout_of(folder: Path) -> tuple[Callable[[Path, Path], Sequence] | None, Path]:
    """Return the reader of a folder, or None, and the file or folder of its truth."""
    if any((folder / name).exists() for name in ("meta.json", "gt.csv")):
        return _read_own, folder / "gt.csv"
    if any((folder / name).exists() for name in ("seqinfo.ini", "gt", "img1")):
        return _read_mot, folder / "gt" / "gt.txt"
    if (folder / "groundtruth.txt").is_file():
        return _read_lines, folder / "groundtruth.txt"
    if (folder / "img").is_dir() or any(folder.glob("groundtruth_rect*.txt")):
        return _read_lines, folder / "groundtruth_rect.txt"
    place = folder.resolve()
    truth = place.parent.parent / "annotations" / f"{place.name}.txt"
    if place.parent.name == "sequences" and truth.is_file():
        return _read_visdrone, truth
    parts = ["Annotations" if part == "JPEGImages" else part for part in place.parts]
    for truth in (folder / "masks", Path(*parts), place.parent / f"{place.name}_GT" / "TRA"):
        if truth.is_dir() and truth != place:
            return _read_masks, truth
    return None, folder


def _read_own(folder: Path, truth: Path) -> Sequence:
    def named(meta: dict[str, Any]) -> tuple[dict[str, Any], str, str]:
        source = meta["frames"]
        if len(source) > 200 or not re.fullmatch(r"[^%]+|[^%]*%(0?[1-9])?d[^%]*", source):
            raise ValueError(f"frames is {source[:40]!r}; name a video, or frames/%04d.png")
        return meta, source, str(meta["name"])

    path = folder / "meta.json"
    meta, source, name = read_json(path, "a description", "the JSON of a sequence", named)
    place = (lambda t: folder / (source % t)) if "%" in source else folder / source
    frames, fps = _described(path, meta, ("n_frames", "width", "height", "fps"), place)
    points = folder / "points.csv"
    if points.is_file() and not truth.exists():
        return Sequence(folder, frames, _read_points(points), fps, name, of_points=True)
    return Sequence(folder, frames, read_boxes(truth, truth=True), fps, name)


def _read_mot(folder: Path, truth: Path) -> Sequence:
    path, parser = folder / "seqinfo.ini", configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(read_text(path, "a description", "seqinfo.ini of the MOTChallenge"))
        about = parser["Sequence"]
    except (configparser.Error, KeyError) as error:
        cause = " ".join(str(error)[:200].split())
        raise InputError(f"'{path}' has no section [Sequence] ({cause}); correct it") from None
    place = folder / about.get("imDir", "img1")
    pictures = {int(file.stem): file for file in _pictures_of(place) if file.stem.isdecimal()}
    keys = ("seqLength", "imWidth", "imHeight", "frameRate")
    frames, fps = _described(path, about, keys, lambda t: pictures.get(t + 1, place / str(t + 1)))
    return Sequence(folder, frames, read_boxes(truth, truth=True), fps, about.get("name", ""))


def _read_lines(folder: Path, truth: Path) -> Sequence:
    """OTB, LaSOT, GOT-10k and VOT: a line per picture; corners count from 1."""
    several = {path.name.split(".")[1]: path for path in folder.glob("groundtruth_rect.*.txt")}
    numbered = {int(name): path for name, path in several.items() if name.isdecimal()}
    truths = numbered if numbered and not truth.is_file() else {1: truth}
    hidden = _marked_frames(folder / "full_occlusion.txt")
    absent = _marked_frames(folder / "out_of_view.txt") | _marked_frames(folder / "absence.label")
    lines = {identity: _boxes_in(path) for identity, path in truths.items()}
    rows = [
        (frame, identity, *box, 2 if frame in hidden else -1, 1)
        for identity, boxes in lines.items()
        for frame, box in enumerate(boxes)
        if frame not in absent and min(box[2:]) > 0
    ]
    count = max(map(len, lines.values()))
    places = [place for place in (folder / "img", folder / "color") if place.is_dir()]
    pictures = _pictures_of(*places[:1] or [folder])
    least = _OTB_FIRST_PICTURE.get(folder.resolve().name.lower())
    if least and len(pictures) > count:
        pictures = [file for file in pictures if int(file.stem) >= least]
    if len(pictures) < count:
        raise InputError(
            f"'{next(iter(truths.values()))}' has {count} lines, one per picture, and "
            f"'{folder}' has {len(pictures)} pictures; add the others"
        )
    return Sequence(folder, Frames(tuple(pictures[:count])), table_of(rows, truth))


def _read_visdrone(folder: Path, truth: Path) -> Sequence:
    return Sequence(folder, Frames(tuple(_pictures_of(folder))), read_boxes(truth, truth=True))


def _read_masks(folder: Path, truth: Path) -> Sequence:
    inner = next((folder / name for name in ("frames", "img1") if (folder / name).is_dir()), folder)
    pictures, masks = _pictures_of(inner), label_images(truth)
    numbers = _numbers_of(pictures)
    rows = [
        (numbers.index(number), *row, -1, 1)
        for number, mask in masks.items()
        if number in numbers
        for row in _boxes_around(read_mask(mask))
    ]
    return Sequence(folder, Frames(tuple(pictures)), table_of(rows, truth))


def label_images(folder: Path) -> dict[int, Path]:
    """Return frame number -> label image; the order counts if no name has a number.

    Raises:
        InputError: a name has no number, or the number of another one.
    """
    masks = pictures_in(folder)
    found: dict[int, Path] = {}
    for number, mask in zip(_numbers_of(masks), masks, strict=True):
        if number is None or number in found:
            state = "has no number" if number is None else f"has the number {number} again"
            raise InputError(
                f"mask '{mask}' {state}; the number in a name is the frame's number, so "
                "rename or remove it."
            )
        found[number] = mask
    return found


def _numbers_of(files: list[Path]) -> list[Any]:
    numbers = frame_numbers([file.name for file in files])
    return list(range(len(files))) if set(numbers) == {None} else list(numbers)


def _pictures_of(folder: Path) -> list[Path]:
    """The pictures of a folder; if some are numbered by their whole names, only those."""
    pictures = pictures_in(folder) if folder.is_dir() else []
    if not pictures:
        raise InputError(f"'{folder}' holds no pictures; put the sequence's frames there")
    return [file for file in pictures if file.stem.isdecimal()] or pictures


def _described(
    path: Path,
    about: Mapping[str, object],
    keys: tuple[str, ...],
    place: Path | Callable[[int], Path],
) -> tuple[Frames, float]:
    """The frames that a description announces, and their rate per second.

    ``keys`` name the number of frames, width, height and rate; ``place`` is the video, or a
    function of a frame's number that returns its picture.
    """
    count, *size, fps = (
        parse_number(str(about.get(key)), f"'{path}': {key} is", "give a number", **limits)
        for key, limits in zip(keys, _LIMITS, strict=True)
    )
    numbers = range(int(count))
    frames = Frames(tuple(map(place, numbers)) if callable(place) else place, numbers)
    height, width = frames.shape[1:3]
    if [width, height] != size:
        raise InputError(
            f"'{path}' says {size[0]:.0f} x {size[1]:.0f} pixels, and the frames measure {width} x "
            f"{height}; correct it, if the truth belongs to them"
        )
    return frames, fps


def _boxes_in(path: Path) -> list[tuple[float, ...]]:
    """Boxes of a file with one line per frame, of size 0 where the object is absent."""
    boxes = []
    text = read_text(path, "boxes", "lines x,y,w,h, one per picture")
    for number, line in enumerate(text.rstrip().splitlines(), start=1):
        # A line's place is its frame, so that a blank one counts, too.
        fields = re.split(r"[,;\s]+", line.strip()) if line.strip() else ["nan"] * 4
        place = f"line {number} of '{path}'"
        if len(fields) not in (4, 8):
            raise InputError(f"{place} has {len(fields)} columns; expected 4, x,y,w,h")
        if all(field.lower() == "nan" for field in fields):
            fields = ["0"] * 4
        values = [parse_number(field, f"{place} holds", "give a number") for field in fields]
        if len(values) == 8:  # corners of a quadrangle
            corners = np.reshape(values, (4, 2))
            values = [*corners.min(axis=0), *np.ptp(corners, axis=0)]
        if min(values[2:]) < 0:
            raise InputError(f"{place} has a box of negative size; give x,y,w,h")
        boxes.append((values[0] - 1, values[1] - 1, *values[2:]))
    if not boxes:
        raise InputError(f"'{path}' holds no boxes; expected lines x,y,w,h, one per picture")
    return boxes


def _marked_frames(path: Path) -> set[int]:
    """Frames that a file of LaSOT or GOT-10k marks by 1; none without the file."""
    text = read_text(path, "marks", "0 or 1 for every frame") if path.is_file() else ""
    marks = re.split(r"[ \t\r]*[,;\n][ \t\r]*|[ \t]+", text.rstrip())  # some may be blank
    return {t for t, mark in enumerate(marks) if mark == "1"}


def _boxes_around(levels: np.ndarray) -> list[tuple[float, ...]]:
    """(number, x, y, w, h) of the pixels of every number above 0."""
    rows, columns = np.nonzero(levels > 0)
    numbers, of = np.unique(levels[rows, columns], return_inverse=True)
    low, high = np.full((len(numbers), 2), math.inf), np.zeros((len(numbers), 2))
    places = np.stack([columns, rows], axis=1)
    np.minimum.at(low, of, places)
    np.maximum.at(high, of, places + 1)
    return [
        (number, *corner, *extent)
        for number, corner, extent in zip(numbers, low, high - low, strict=True)
    ]


def _read_points(path: Path) -> BoxTable:
    """Windows around the annotated points that are visible."""
    rows = []
    for place, fields in read_below(path, "points", _POINTS, f"{_POINTS},visible"):
        frame, number, x, y, visible = (
            parse_number(field, f"{place} holds", "give a number", **limits)
            for field, limits in zip([*fields, "1"][:5], [_WHOLE, _WHOLE, {}, {}, {}], strict=True)
        )
        if visible:
            box = (x - _WINDOW / 2, y - _WINDOW / 2, _WINDOW, _WINDOW)
            rows.append((frame, number, *box, -1, 1))
    return table_of(rows, path)
