"""``jaxpf example``: a short clip for trying the tracker, with its start and ground truth."""

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd

import scenes
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import Command, GivenPath, overwrite
from jaxpf.contours.files import contours_text
from jaxpf.detections.files import write_detections
from jaxpf.evaluation.baselines.simulated_detections import simulated_detections
from jaxpf.files.writing import prepare_output_folder, write_text
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
    truth = _rows("frame,id,x,y,w,h", scene.boxes)
    _save(folder / "start.csv", truth[truth["frame"] == 0])
    _save(folder / "truth.csv", truth)


def _write_detections_of(folder: Path, scene: Scene) -> None:
    detections = simulated_detections(scene.boxes, scene.frames.shape[1:3], seed=_SEED)
    write_detections(folder / "det.txt", detections)
    _save(folder / "truth.csv", _rows("frame,id,x,y,w,h", scene.boxes))


def _write_parts(folder: Path, scene: Scene) -> None:
    names = ["body", *(f"{side} {at}" for at in (1, 2, 3) for side in ("left", "right"))]
    poses, parents = scene.extras["poses"], scene.extras["parents"]
    sizes = np.broadcast_to(scene.sizes, (len(poses), *scene.sizes.shape))
    places = np.concatenate([poses[..., :2], sizes, np.rad2deg(poses[..., 2:])], axis=-1)
    truth = _rows("frame,part,x,y,w,h,angle", places, names)
    start = truth[truth["frame"] == 0].assign(
        parent=[names[parent] if parent >= 0 else "" for parent in parents]
    )
    _save(folder / "parts.csv", start[HEADER.split(",")])
    _save(folder / "truth.csv", truth)


def _write_points(folder: Path, scene: Scene) -> None:
    names, seen = np.array(scene.extras["point_names"]), scene.extras["visible"]
    truth = _rows("frame,point,x,y", scene.extras["points"], names)
    start = truth[truth["frame"] == 0]
    _save(folder / "points.csv", start[["x", "y", "point"]], header=False)
    hidden = ~seen[np.isfinite(scene.extras["points"]).all(axis=-1)]
    _save(folder / "truth.csv", truth.assign(hidden=hidden.astype(int)))


def _write_contours(folder: Path, scene: Scene) -> None:
    start: Any = all_targets()["contours"].scene_start(scene)
    write_text(folder / "wires.json", contours_text(start.contours))
    _save(folder / "centrelines.csv", _rows("frame,id,k,x,y", scene.extras["outlines"]))


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


def _rows(
    columns: str, places: np.ndarray, names: Sequence[str] | np.ndarray | None = None
) -> pd.DataFrame:
    """Rows of the finite places ``[T, P, ..., C]``: frame, object's name, further indices, place.

    Objects are named by their numbers, from 1, unless ``names`` gives their names.
    """
    index = np.nonzero(np.isfinite(places).all(axis=-1))
    called = np.arange(1, places.shape[1] + 1) if names is None else np.asarray(names)
    values = [index[0], called[index[1]], *index[2:], *np.asarray(places)[index].T]
    return pd.DataFrame(dict(zip(columns.split(","), values, strict=True)))


def _save(path: Path, table: pd.DataFrame, header: bool = True) -> None:
    text = table.to_csv(index=False, header=header, float_format="%.3f", lineterminator="\n")
    write_text(path, text)
