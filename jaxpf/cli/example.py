"""``jaxpf example``: a short clip for trying the tracker, with its start and ground truth."""

import shlex
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click
import numpy as np

import scenes
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import Command, GivenPath, overwrite
from jaxpf.contours.files import contours_text
from jaxpf.detections.files import write_detections
from jaxpf.evaluation.baselines.simulated_detections import simulated_detections
from jaxpf.files.writing import csv_text, prepare_output_folder, write_text
from jaxpf.media.video_writer import VideoWriter
from jaxpf.parts.files import HEADER
from jaxpf.targets.registry import all_targets
from scenes import Scene

_SEED = 1


@click.command("example", cls=Command)
@click.argument(
    "kind",
    type=click.Choice(["boxes", "parts", "points", "contours", "detections"]),
    metavar="KIND",
)
@click.argument("folder", type=GivenPath())
@overwrite
def command(kind: str, folder: Path, overwrite: bool) -> None:
    """Write a short synthetic clip to FOLDER, with start positions and ground truth.

    KIND is boxes or detections (people in a street), parts (a puppet), points (a fish in a school)
    or contours (two wires).  The command prints how to track the clip.
    """
    draw, write, track = _EXAMPLES[kind]
    prepare_output_folder(folder, overwrite)
    scene = draw()
    height, width = scene.frames.shape[1:3]
    with VideoWriter(folder / "clip.mp4", width, height, scene.fps) as video:
        for frame in scene.frames:
            video.write(frame)
    write(folder, scene)
    names = ", ".join(sorted(path.name for path in folder.iterdir()))
    say(f"{folder}/: {names}; {scene.num_frames} frames of {width}x{height} pixels.  Try:")
    place = shlex.quote(str(folder))
    say(f"  jaxpf {track.format(place)} -o {place}/tracks")


def _write_boxes(folder: Path, scene: Scene) -> None:
    _table(folder / "start.csv", "frame,id,x,y,w,h", _box_rows(scene.boxes[:1]))
    _table(folder / "truth.csv", "frame,id,x,y,w,h", _box_rows(scene.boxes))


def _write_detections_of(folder: Path, scene: Scene) -> None:
    detections = simulated_detections(scene.boxes, scene.frames.shape[1:3], seed=_SEED)
    write_detections(folder / "det.txt", detections)
    _table(folder / "truth.csv", "frame,id,x,y,w,h", _box_rows(scene.boxes))


def _write_parts(folder: Path, scene: Scene) -> None:
    names = ["body", *(f"{side} {at}" for at in (1, 2, 3) for side in ("left", "right"))]
    poses, parents = scene.extras["poses"], scene.extras["parents"]
    places = [
        [
            _rounded(x, y, *size, np.rad2deg(angle))
            for (x, y, angle), size in zip(each, scene.sizes, strict=True)
        ]
        for each in poses
    ]
    above = [names[parent] if parent >= 0 else "" for parent in parents]
    start = ([*part, *place] for *part, place in zip(names, above, places[0], strict=True))
    _table(folder / "parts.csv", HEADER, start)
    rows = (
        [frame, name, *place]
        for frame, each in enumerate(places)
        for name, place in zip(names, each, strict=True)
    )
    _table(folder / "truth.csv", "frame,part,x,y,w,h,angle", rows)


def _write_points(folder: Path, scene: Scene) -> None:
    names, points = scene.extras["point_names"], scene.extras["points"]
    start = ([*_rounded(*place), name] for name, place in zip(names, points[0], strict=True))
    _table(folder / "points.csv", None, start)
    rows = (
        [frame, names[point], *_rounded(*places[point]), int(not seen[point])]
        for frame, (places, seen) in enumerate(zip(points, scene.extras["visible"], strict=True))
        for point in np.flatnonzero(np.isfinite(places).all(axis=-1))
    )
    _table(folder / "truth.csv", "frame,point,x,y,hidden", rows)


def _write_contours(folder: Path, scene: Scene) -> None:
    start: Any = all_targets()["contours"].scene_start(scene)
    write_text(folder / "wires.json", contours_text(start.contours))
    rows = (
        [frame, wire, number, *_rounded(*point)]
        for frame, wires in enumerate(scene.extras["outlines"])
        for wire, line in enumerate(wires, start=1)
        for number, point in enumerate(line)
    )
    _table(folder / "centrelines.csv", "frame,id,k,x,y", rows)


#: Kind -> how its scene is drawn, how its files are written, and how it is tracked.
_EXAMPLES: "dict[str, tuple[Callable[[], Scene], Callable[[Path, Scene], None], str]]" = {
    "boxes": (
        lambda: scenes.street_scene(seed=_SEED),
        _write_boxes,
        "track {0}/clip.mp4 --boxes {0}/start.csv --truth {0}/truth.csv",
    ),
    "parts": (
        lambda: scenes.puppet_scene(seed=_SEED),
        _write_parts,
        "track parts {0}/clip.mp4 --parts {0}/parts.csv",
    ),
    "points": (
        lambda: scenes.make("fish", seed=_SEED, num_frames=60, frame_width=640, frame_height=360),
        _write_points,
        "track points {0}/clip.mp4 --points {0}/points.csv",
    ),
    "contours": (
        lambda: scenes.make("wires", seed=_SEED, clutter=20.0, clutter_grain=5.0),
        _write_contours,
        "track contours {0}/clip.mp4 --contours {0}/wires.json --sigma 3",
    ),
    "detections": (
        lambda: scenes.street_scene(120, seed=_SEED, come_and_go=True),
        _write_detections_of,
        "track {0}/clip.mp4 --detections {0}/det.txt",
    ),
}


def _box_rows(boxes: np.ndarray) -> Iterable[list[object]]:
    for frame, person in np.argwhere(np.isfinite(boxes).all(axis=-1)):
        yield [frame, person + 1, *_rounded(*boxes[frame, person])]


def _rounded(*numbers: float) -> list[str]:
    return [f"{number:.3f}" for number in numbers]


def _table(path: Path, header: str | None, rows: Iterable[Iterable[object]]) -> None:
    write_text(path, (f"{header}\n" if header else "") + csv_text(rows))
