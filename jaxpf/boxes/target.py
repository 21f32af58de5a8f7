"""Boxes as a kind of target: their files, truth and pictures; shapes are x, y, w, h in pixels."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.boxes.factory import settle, start, tracker
from jaxpf.boxes.models import boxes_at
from jaxpf.boxes.rowe2005 import rowe2005_tracker
from jaxpf.boxes.tracks import check_boxes, parse_box
from jaxpf.contract.errors import InputError
from jaxpf.measures import metrics
from jaxpf.media.film import FrameSource
from jaxpf.media.overlay import draw_boxes
from jaxpf.sequences.layouts import read_truth
from jaxpf.sequences.tables import BoxTable, listed
from jaxpf.targets.target import Marks, Start, Target


def _outlines(shapes: ArrayLike, sizes: ArrayLike) -> jax.Array:
    x, y, w, h = jnp.moveaxis(jnp.asarray(shapes), -1, 0)
    corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
    return jnp.stack([jnp.stack(corner, axis=-1) for corner in corners], axis=-2)


def _read_start(given: Mapping[str, Any], number: int, source: FrameSource) -> Start:
    if given["box"] and given["boxes"]:
        raise InputError("--box and --boxes were both given; use one of them.")
    if given["ids"] is not None and not given["boxes"]:
        raise InputError("--ids names objects of a CSV file; give the file with --boxes.")
    if given["boxes"]:
        return start_boxes(read_truth(given["boxes"]), number, source, given["ids"])
    if not given["box"]:
        if given.get("detections"):
            return start(np.zeros((0, 4)))
        raise InputError(
            "no start box: give --box x,y,w,h for every object, or --boxes FILE.csv.  Draw the "
            f"start boxes with `jaxpf mark {source.path}`."
        )
    begun = start(np.stack([parse_box(text) for text in given["box"]]))
    check_boxes(begun.shapes, source.width, source.height, [f"object {i}" for i in begun.ids])
    return begun


def start_boxes(
    table: BoxTable, first: int, source: FrameSource, ids: Sequence[int] | None = None
) -> Start:
    """The objects that start in a frame, and in later ones, see ``Start.from_rows``.

    Args:
        table: boxes of a file.
        first: the start frame, counting from 0.
        source: the video.
        ids: the objects asked for; by default all, in the order of the file.

    Raises:
        InputError: no box in that frame, an unknown id, an id asked for twice, or a box outside.
    """
    if first not in table.frame:
        raise InputError(
            f"{table.source} has no box with an area in frame {first}; choose a start frame among "
            f"{listed(np.unique(table.frame)) or 'none'} (counting from 0)"
        )
    asked = np.isin(table.id, table.id if ids is None else ids)

    def start_at(frame: int) -> Start:
        rows = np.flatnonzero(asked & (table.frame == frame))
        if ids is not None and frame == first:
            order = [[*ids].index(each) for each in table.id[rows].tolist()]
            rows = rows[np.argsort(order)]
        names = [f"object {i} in frame {frame}" for i in table.id[rows]]
        check_boxes(table.box[rows], source.width, source.height, names)
        return start(table.box[rows], table.id[rows])

    begun = Start.from_rows(table.frame[asked], table.id[asked], first, start_at)
    known = {i for each in (begun, *begun.later.values()) for i in each.ids.tolist()}
    for identity in ids or ():
        if identity not in known or [*(ids or ())].count(identity) > 1:
            there = sorted(table.id[table.frame == first].tolist())
            raise InputError(
                f"id {identity} has no box in frame {first} of {table.source}, or is asked for "
                f"twice; the ids there are {listed(there)}{'; '.join(('', *begun.remarks))}"
            )
    return begun


def _draw(frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
    return draw_boxes(frame, shapes, list(start.ids), marks.colours, marks.lost, marks.doubtful)


BOXES = Target(
    name="boxes",
    tracker=tracker,
    start=start,
    settle=settle,
    shapes=lambda start, estimate, tracker: boxes_at(estimate, start.sizes),
    outlines=_outlines,
    measure=metrics.measure_boxes,
    read_start=_read_start,
    scene_shapes=lambda scene: np.asarray(scene.boxes, np.float64),
    scene_start=lambda scene: start(scene.boxes[0], scene.extras.get("ids")),
    columns=("x", "y", "w", "h"),
    column_values=lambda start, shapes: shapes,
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
