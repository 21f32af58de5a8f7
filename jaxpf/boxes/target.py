"""Boxes as a kind of target: their files, truth and pictures; shapes are x, y, w, h in pixels."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.boxes import tracks
from jaxpf.boxes.factory import settle, start, tracker, unchecked_start
from jaxpf.boxes.models import boxes_at
from jaxpf.boxes.rowe2005 import rowe2005_tracker
from jaxpf.contract.errors import InputError
from jaxpf.targets.later import starts_by_frame
from jaxpf.targets.target import Marks, Start, Target

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.media.film import FrameSource
    from scenes import Scene


def _outlines(start: Start, shapes: "ArrayLike") -> "jax.Array | np.ndarray":
    import jax.numpy as jnp

    x, y, w, h = jnp.moveaxis(jnp.asarray(shapes), -1, 0)
    corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
    return jnp.stack([jnp.stack(corner, axis=-1) for corner in corners], axis=-2)


def _measures(start: Start, shapes: "ArrayLike", truth: "ArrayLike") -> dict[str, Any]:
    """Exact measures for boxes."""
    import jax.numpy as jnp

    from jaxpf.measures import metrics

    return {
        "present": metrics.has_truth(truth),
        "tracked": metrics.track_state(shapes, truth),
        "precision": metrics.precision(shapes, truth),
        "recall": metrics.recall(shapes, truth),
        "iou": metrics.iou(shapes, truth),
        "centre_error": metrics.centre_error(shapes, truth),
        "corner_error": jnp.full(jnp.shape(shapes)[:-1], jnp.nan),
    }


def _read_start(given: Mapping[str, Any], number: int, source: "FrameSource") -> Start:
    from jaxpf.sequences.layouts import read_truth

    if given["box"] and given["boxes"]:
        raise InputError("--box and --boxes were both given; use one of them.")
    if given["ids"] is not None and not given["boxes"]:
        raise InputError("--ids names objects of a CSV file; give the file with --boxes.")
    if given["boxes"]:
        table = read_truth(given["boxes"])
        ids, boxes = tracks.start_boxes(table, number, _starting(table, number, given["ids"]))
    elif given["box"]:
        boxes = np.stack([tracks.parse_box(text) for text in given["box"]])
        ids = np.arange(1, len(boxes) + 1)
    elif given.get("detections"):
        return unchecked_start(np.zeros((0, 4)))
    else:
        raise InputError(
            "no start box: give --box x,y,w,h for every object, or --boxes FILE.csv.  Draw the "
            f"start boxes with `jaxpf mark {source.path}`."
        )
    tracks.check_boxes(boxes, source.width, source.height, [f"object {i}" for i in ids])
    return unchecked_start(boxes, ids)


def _later_starts(
    given: Mapping[str, Any], number: int, source: "FrameSource"
) -> tuple[dict[int, Start], str | None]:
    """Boxes of later frames in the file of --boxes."""
    from jaxpf.sequences.layouts import read_truth

    if not given["boxes"]:
        return {}, None
    table = read_truth(given["boxes"])
    ids = table.id if given["ids"] is None else given["ids"]
    named = np.isin(table.id, ids)

    def start_at(frame: int) -> Start:
        rows = named & (table.frame == frame)
        names = [f"object {i} in frame {frame}" for i in table.id[rows]]
        tracks.check_boxes(table.box[rows], source.width, source.height, names)
        return unchecked_start(table.box[rows], table.id[rows])

    later, note = starts_by_frame(table.frame[named], table.id[named], number, start_at)
    here = table.id[table.frame == number]
    absent = np.setdiff1d(ids, np.concatenate([here, *(each.ids for each in later.values())]))
    if given["ids"] is not None and len(absent):
        raise InputError(
            f"id {absent[0]} has no box in frame {number} of {table.source}, which holds whole "
            "tracks, so that only its start frame is used; choose another --start."
        )
    return later, note


def _scene_shapes(scene: "Scene") -> np.ndarray:
    return np.asarray(scene.boxes, np.float64)


def _scene_start(scene: "Scene") -> Start:
    return unchecked_start(scene.boxes[0], scene.extras.get("ids"))


def _column_values(start: Start, shapes: np.ndarray) -> np.ndarray:
    """The top left corner and the size."""
    return shapes


def _draw(frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
    from jaxpf.media.overlay import draw_boxes

    return draw_boxes(frame, shapes, list(start.ids), marks.colours, marks.lost, marks.doubtful)


def _starting(table: "tracks.BoxTable", number: int, ids: Sequence[int] | None) -> list[int] | None:
    """Those of the ids asked for that do not start in a later frame."""
    if ids is None:
        return None
    here, later = table.id[table.frame == number], table.id[table.frame > number]
    return [each for each in ids if each in here or each not in later]


BOXES = Target(
    name="boxes",
    tracker=tracker,
    start=start,
    settle=settle,
    shapes=lambda start, estimate, tracker: boxes_at(estimate, start.sizes),
    outlines=_outlines,
    measure=_measures,
    read_start=_read_start,
    later_starts=_later_starts,
    scene_shapes=_scene_shapes,
    scene_start=_scene_start,
    columns=("x", "y", "w", "h"),
    column_values=_column_values,
    draw=_draw,
    can_be_tuned=True,
    systems={"rowe2005": rowe2005_tracker},
    has_boxes=True,
    example="--box 120,80,40,90 --box 300,85,42,88",
    start_flags={
        "box": {"multiple": True, "metavar": "X,Y,W,H", "help": "A start box; repeat it."},
        "boxes": {
            "type": Path,
            "help": "CSV of start boxes, such as frame,id,x,y,w,h.  With that header, or that of a "
            "tracks.csv, frames and x, y count from 0; without a header, as in MOT files, from 1.  "
            "A box in a later frame starts its object there, or corrects it.",
        },
        "ids": {"type": [int], "help": "Objects of --boxes, such as 1,2,5."},
        "detections": {
            "type": Path,
            "help": "Detections that start and end tracks: a MOT det.txt.  Objects are tracked by "
            "colour and the labelled filter, by default with 100 particles for each of "
            "--capacity.  A line with an id in the place of -1 starts that object there, detected "
            "or not.",
        },
    },
)
