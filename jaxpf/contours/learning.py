"""Learns the shape space and dynamics of contours from annotated frames of a clip.

Annotations are masks, outlines or centrelines.  Outlines and centrelines are CSV with the header
``frame,id,k,x,y``: the k-th point of a target in a frame, in continuous pixels; k marks the same
spot of the body in every frame.  The outlines.csv of a run is read, too, but for its control
points.  Masks are one picture per frame; the number in the name is the frame's number, and if no
name has one, the order of the names counts.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contours.files import Learned
from jaxpf.contours.target import TRACK_HEADER
from jaxpf.contract.errors import InputError
from jaxpf.dynamics.learned import fit
from jaxpf.files.reading import parse_number, read_below
from jaxpf.media.images import read_mask
from jaxpf.sequences.layouts import label_images
from jaxpf.shapes.learning import ANNOTATIONS, augment, learn_shape_space
from jaxpf.shapes.spaces import ShapeSpace, key_frame_space
from jaxpf.shapes.splines import points_on

_HEADER = ("frame", "id", "k", "x", "y")
#: Number of points at which contours are compared.
_POINTS = 64
#: Maximum number of control points: memory and time grow with its square.
_MOST_POINTS = 500

#: Lines by frame and target, ``[S, 2]``, or pictures ``[H, W]`` that are nonzero on it.
Lines = dict[tuple[int, str], np.ndarray]


class Annotated(NamedTuple):
    """Annotated contours: of which of ``ANNOTATIONS``, and by frame, from 0, and target."""

    kind: str
    lines: Lines


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
    if kind is None:
        there = [name for name in ANNOTATIONS[1:] if (folder / f"{name}.csv").is_file()]
        kind = there[-1] if there else "masks"
    if value is not None and kind != "masks":
        raise InputError(
            f"object {value} selects a mask, and '{folder}' holds {kind}; leave it out."
        )
    until = np.inf if last is None else last
    if kind == "masks":
        lines = _read_masks(folder, value, first, until)
    else:
        lines = _read_points(folder / f"{kind}.csv", first, until)
    if not lines:
        end = "on" if last is None else f"to {last}"
        raise InputError(
            f"'{folder}' holds no {kind} in the frames from {first} {end}; there are no key frames "
            "to learn from: mark some, or choose other frames."
        )
    return Annotated(kind, lines)


def _read_masks(folder: Path, value: int | None, first: int, until: float) -> Lines:
    place = folder / "masks" if (folder / "masks").is_dir() else folder
    paths = {at: path for at, path in label_images(place).items() if first <= at <= until}
    masks = {number: read_mask(path) for number, path in paths.items()}
    sizes = {mask.shape: paths[number] for number, mask in masks.items()}
    if len(sizes) > 1:
        ((height, width), one), ((rows, columns), other), *_ = sizes.items()
        raise InputError(
            f"mask '{other}' is {columns}x{rows} and '{one}' is {width}x{height}; give masks of "
            "one size, that of the frames."
        )
    objects = sorted({int(level) for mask in masks.values() for level in np.unique(mask) if level})
    if (value is None and len(objects) > 1) or (objects and value not in (None, *objects)):
        raise InputError(
            f"the masks in '{place}' hold the objects {', '.join(map(str, objects))}; choose one "
            "by --object."
        )
    marked = {
        (number, "1"): mask > 0 if value is None else mask == value
        for number, mask in masks.items()
    }
    return {key: mask for key, mask in marked.items() if mask.any()}


def _read_points(path: Path, first: int, until: float) -> Lines:
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


def learn_contours(
    annotated: Annotated,
    *,
    dimension: int = 8,
    num_points: int = 12,
    order: int = 2,
    coefficients: str = "steps",
    turns: int = 0,
) -> tuple[Learned, list[str]]:
    """Learn shapes and motion from annotated contours, pooled over all targets.

    Args:
        annotated: from ``read_annotated``.
        dimension: D, of the shape space.
        num_points: K, control points of a contour.
        order: of the dynamics, 1 or 2; 0 learns none.
        coefficients: see ``jaxpf.dynamics.fit``.
        turns: of centrelines, number of directions for data augmentation by rotation, mirroring
            and reversal (``jaxpf.shapes.learning.augment``); 0 for no augmentation.

    Returns:
        The learned model, and sentences on its fit.

    Raises:
        InputError: too few contours for the dimension, too few frames for the dynamics, too many
            control points, or turns of closed contours.
    """
    if num_points > _MOST_POINTS:
        raise InputError(
            f"{num_points} control points are too many to learn from; give {_MOST_POINTS} at most."
        )
    space, control = learn_shape_space(
        list(annotated.lines.values()),
        annotated.kind,
        num_points=num_points,
        dimension=dimension,
        ordered=annotated.kind != "masks",
    )
    if turns:
        if space.closed:
            raise InputError(
                f"turns {turns} are of centrelines, and {annotated.kind} were given; leave them "
                "out."
            )
        space = key_frame_space(augment(control, turns), dimension, closed=False)
    tracks = _tracks(space, list(annotated.lines), control)
    report = [_followed(space, control, tracks)]
    if order == 0:
        return Learned(space, None), report
    dynamics = fit(tracks, order, coefficients=coefficients, pooled=True)
    noise = np.linalg.norm(np.asarray(dynamics.noise)[0], axis=1)
    report.append(
        f"Dynamics of order {order}; noise of each coordinate per frame, pixels: "
        f"{', '.join(f'{value:.2f}' for value in noise)}."
    )
    return Learned(space, dynamics), report


def _tracks(space: ShapeSpace, keys: list[tuple[int, str]], control: np.ndarray) -> np.ndarray:
    """``[T, P, D]``, NaN where nothing is marked."""
    frames, names = zip(*keys, strict=True)
    known = sorted(set(names))
    tracks = np.full((max(frames) - min(frames) + 1, len(known), space.dimension), np.nan)
    columns = [known.index(name) for name in names]
    tracks[np.subtract(frames, min(frames)), columns] = space.project(control[:, None])[:, 0]
    return tracks


def _followed(space: ShapeSpace, control: np.ndarray, tracks: np.ndarray) -> str:
    drawn = np.asarray(space.control_points(space.project(control[:, None])))
    kind: dict[str, Any] = {"closed": space.closed, "degree": space.degree}
    gaps = points_on(drawn[:, 0], _POINTS, **kind) - points_on(control, _POINTS, **kind)
    kept = f", which hold them to {np.sqrt(np.mean(np.sum(gaps**2, axis=-1))):.2f} pixels"
    return (
        f"{len(control)} contour(s) of {tracks.shape[1]} target(s) in {len(tracks)} frame(s): "
        f"{space.dimension} dimensions{kept}."
    )
