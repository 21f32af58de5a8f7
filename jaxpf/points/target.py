"""Points as a kind of target: their files, truth and pictures; shapes are x, y in pixels."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.media.film import FrameSource
from jaxpf.media.images import read_mask
from jaxpf.points.drawing import draw_points
from jaxpf.points.factory import settle, start, tracker
from jaxpf.points.files import Points, grid_points, parse_points, read_points
from jaxpf.targets.target import Marks, Start, Target, check_inside
from scenes import Scene

#: Default spacing of a grid of points, pixels.
_MASK_STEP = 20.0


def _outlines(shapes: ArrayLike, sizes: ArrayLike) -> jax.Array:
    """Squares around the points, where polygons are needed."""
    half = jnp.asarray(sizes, jnp.asarray(shapes).dtype)[:, None] / 2
    corners = jnp.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], half.dtype)
    return jnp.asarray(shapes)[..., None, :] + corners * half


def _read_start(given: Mapping[str, Any], number: int, source: FrameSource) -> Start:
    said = [name for name in ("point", "points", "mask") if given[name]]
    if len(said) > 1:
        raise InputError(f"--{said[0]} and --{said[1]} were both given; use one of them.")
    if not said:
        raise InputError(
            "no start point: give --point x,y for every point, --points FILE.csv or --mask "
            f"PICTURE.  Draw the points with `jaxpf mark {source.path} --target points`."
        )
    if given["mask_step"] is not None and not given["mask"]:
        raise InputError("--mask-step works only with --mask; add --mask PICTURE, or leave it out.")
    if given["mask"]:
        step = _MASK_STEP if given["mask_step"] is None else given["mask_step"]
        points = _on_mask(given["mask"], step, source)
    else:
        typed, path = given["point"], given["points"]
        points = read_points(path) if path else parse_points(typed)

    def start_at(frame: int) -> Start:
        there = points.at(frame)
        check_inside("point", there.names, there.places, source)
        return start(there.places, there.names)

    if points.frames is None:
        return start_at(number)
    return Start.from_rows(points.frames, np.array(points.names), number, start_at)


def _scene_shapes(scene: Scene) -> np.ndarray | None:
    """Hidden points count as absent."""
    if "points" not in scene.extras:
        return None
    return np.where(scene.extras["visible"][..., None], scene.extras["points"], np.nan)


def _scene_start(scene: Scene) -> Start:
    """Raise InputError: a point is hidden in the first frame."""
    names, shown = scene.extras["point_names"], scene.extras["visible"][0]
    for name, visible in zip(names, shown, strict=True):
        if not visible:
            raise InputError(
                f"point '{name}' of scene '{scene.name}' is hidden in the first frame, so that "
                "nothing is known of its looks; leave it out or begin with another frame."
            )
    return start(scene.extras["points"][0], names)


def _draw(frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
    """Lost points are hollow, and doubtful ones have a question mark."""
    doubtful = np.zeros(len(start.ids), bool) if marks.doubtful is None else marks.doubtful
    return draw_points(
        frame,
        shapes,
        trails=marks.past,
        hidden=marks.lost,
        colours=marks.colours,
        names=[
            f"{name} ?" if is_doubtful else f"{name}"
            for name, is_doubtful in zip(start.ids, doubtful, strict=True)
        ],
    )


def _on_mask(path: Path, step: float, source: FrameSource) -> Points:
    """Return points on a grid within a mask of the frame's size."""
    if not path.is_file():
        raise InputError(f"there is no mask at '{path}'; give a picture that is 0 off the body.")
    mask = read_mask(path) > 0
    if not mask.any():
        raise InputError(f"the mask '{path}' is 0 everywhere; mark the body in it.")
    if mask.shape != (source.height, source.width):
        raise InputError(
            f"the mask '{path}' has {mask.shape[1]} x {mask.shape[0]} pixels and the frame "
            f"{source.width} x {source.height}; give a mask of the frame's size."
        )
    return grid_points(mask, step)


POINTS = Target(
    name="points",
    tracker=tracker,
    start=start,
    settle=settle,
    shapes=lambda start, estimate, tracker: np.asarray(estimate)[..., :2],
    outlines=_outlines,
    read_start=_read_start,
    scene_shapes=_scene_shapes,
    scene_start=_scene_start,
    draw=_draw,
    place="point",
    defaults={"method": "sps", "num_particles": 1000},
    example="--point 120,80,nose --point 161,95,shoulder",
    start_flags={
        "point": {"multiple": True, "metavar": "X,Y[,NAME]", "help": "A start point; repeat it."},
        "points": {
            "type": Path,
            "help": "CSV of start points: lines x,y or x,y,name.  With the header frame,id,x,y a "
            "point in a later frame starts there, or is corrected.",
        },
        "mask": {
            "type": Path,
            "help": "A picture of the start frame's size; a grid of points starts where it is not "
            "black.",
        },
        "mask_step": {"type": float, "help": "Pixels between points of that grid.  [default: 20]"},
    },
)
