"""Parts as a kind of target: their files, truth and pictures.

Shapes are poses x, y (pixels), theta (radians).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.media.film import FrameSource
from jaxpf.media.overlay import draw_outlines
from jaxpf.parts.factory import start, tracker
from jaxpf.parts.files import Parts, read_parts
from jaxpf.shapes.rectangles import corners_from_poses
from jaxpf.targets.target import Marks, Start, Target, check_inside
from scenes import Scene


def _read_start(given: Mapping[str, Any], number: int, source: FrameSource) -> Start:
    path = given["parts"]
    if path is None:
        raise InputError(
            "no parts: give --parts FILE.csv.  Draw parts with "
            f"`jaxpf mark {source.path} --target parts`."
        )
    parts = read_parts(path)
    check_inside("the centre of part", parts.names, parts.poses[:, :2], source)
    return start(parts)


def _scene_shapes(scene: Scene) -> np.ndarray | None:
    if not {"poses", "parents"} <= set(scene.extras):
        return None
    return np.asarray(scene.extras["poses"], np.float64)


def _scene_start(scene: Scene) -> Start:
    parents = tuple(int(parent) for parent in scene.extras["parents"])
    ids = scene.extras.get("ids", range(1, len(parents) + 1))
    return start(Parts(tuple(ids), parents, scene.extras["poses"][0], scene.sizes))


def _column_values(start: Start, shapes: np.ndarray) -> np.ndarray:
    """Centre, size and clockwise angle in degrees."""
    sizes = np.broadcast_to(start.sizes, (*shapes.shape[:-1], 2))
    return np.concatenate([shapes[..., :2], sizes, np.rad2deg(shapes[..., 2:3])], axis=-1)


def _draw(frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
    corners = np.asarray(corners_from_poses(np.asarray(shapes), start.sizes), float)
    lines = np.concatenate([corners, corners[:, :1]], axis=1)
    return draw_outlines(frame, lines, start.ids, marks.colours, marks.lost, marks.doubtful)


PARTS = Target(
    name="parts",
    tracker=tracker,
    start=start,
    shapes=lambda start, estimate, tracker: np.asarray(estimate)[..., :3],
    outlines=corners_from_poses,
    read_start=_read_start,
    scene_shapes=_scene_shapes,
    scene_start=_scene_start,
    columns=("x", "y", "w", "h", "angle"),
    fixed_columns=("w", "h"),
    column_values=_column_values,
    draw=_draw,
    can_be_tuned=True,
    defaults={"method": "sps"},
    unsuited=("labelled", "eskil", "pffl"),  # part trees
    example="--parts parts.csv",
    start_flags={
        "parts": {
            "type": Path,
            "help": "CSV of the parts of one or several articulated objects, with the header "
            "part,parent,x,y,w,h,angle (x, y: centre; angle: degrees clockwise; leave parent empty "
            "for each object's root).",
        }
    },
)
