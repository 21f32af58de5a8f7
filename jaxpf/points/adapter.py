"""Reads points from flags, files and masks; writes and draws them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.points.target import POINTS
from jaxpf.targets.adapter import Adapter, Marks, starts_by_frame
from jaxpf.targets.target import Start

#: Default spacing of a grid of points, pixels.
_MASK_STEP = 20.0


class PointAdapter(Adapter):
    """See ``Adapter``."""

    target = POINTS
    example = "--point 120,80,nose --point 161,95,shoulder"
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "point": {"multiple": True, "metavar": "X,Y[,NAME]", "help": "A start point; repeat it."},
        "points": {
            "type": Path,
            "help": "CSV of start points: lines x,y or x,y,name.  With the header frame,id,x,y a "
            "point in a later frame starts there, or is put right.",
        },
        "mask": {
            "type": Path,
            "help": "A picture of the start frame's size; a grid of points starts where it is not "
            "black.",
        },
        "mask_step": {"type": float, "help": "Pixels between points of that grid.  [default: 20]"},
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Adapter``."""
        from jaxpf.points.files import parse_points, read_points

        said = [name for name in ("point", "points", "mask") if given[name]]
        if len(said) > 1:
            raise InputError(f"--{said[0]} and --{said[1]} were both given; use one of them.")
        if not said:
            raise InputError(
                "no start point: give --point x,y for every point, --points FILE.csv or --mask "
                f"PICTURE.  Draw the points with `jaxpf mark {source.path} --target points`."
            )
        if given["mask_step"] is not None and not given["mask"]:
            raise InputError("--mask-step is about the grid on a --mask, and none was given.")
        if given["mask"]:
            step = _MASK_STEP if given["mask_step"] is None else given["mask_step"]
            points = _on_mask(given["mask"], step, source)
        else:
            points = (
                read_points(given["points"]).at(number)
                if given["points"]
                else parse_points(given["point"])
            )
        _check_inside(points, source)
        return POINTS.start(points.places, points.names)

    def later_starts(
        self, given: Mapping[str, Any], number: int, source: Any
    ) -> tuple[dict[int, Start], str | None]:
        """See ``Adapter``: points of later frames in the file of --points."""
        from jaxpf.points.files import read_points

        points = read_points(given["points"]) if given["points"] else None
        if points is None or points.frames is None:
            return {}, None

        def start_at(frame: int) -> Start:
            there = points.at(frame)
            _check_inside(there, source)
            return POINTS.start(there.places, there.names)

        return starts_by_frame(points.frames, np.array(points.names), number, start_at)

    def fits_scene(self, scene: Any) -> bool:
        """Whether the ground truth has points."""
        return "points" in scene.extras

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Adapter``; hidden points count as absent."""
        points, visible = scene.extras["points"], scene.extras["visible"]
        return np.where(visible[..., None], points, np.nan)

    def scene_start(self, scene: Any) -> Start:
        """See ``Adapter``.

        Raises:
            InputError: a point is hidden in the first frame.
        """
        names, shown = scene.extras["point_names"], scene.extras["visible"][0]
        for name, visible in zip(names, shown, strict=True):
            if not visible:
                raise InputError(
                    f"point '{name}' of scene '{scene.name}' is hidden in the first frame, so that "
                    "nothing is known of its looks; leave it out or begin with another frame."
                )
        return POINTS.start(scene.extras["points"][0], names)

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Adapter``; lost points are hollow, and doubtful ones have a question mark."""
        from jaxpf.points.drawing import draw_points

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


ADAPTER = PointAdapter()


def _check_inside(points: Any, source: Any) -> None:
    """Refuse a point outside the frame."""
    for name, (x, y) in zip(points.names, points.places, strict=True):
        if not (0 <= x < source.width and 0 <= y < source.height):
            raise InputError(
                f"point '{name}' is at ({x:g}, {y:g}), outside the frame of {source.width} x "
                f"{source.height} pixels: move it inside, or leave it out."
            )


def _on_mask(path: Path, step: float, source: Any) -> Any:
    """Return points on a grid within a mask of the frame's size."""
    from jaxpf.media.images import read_mask
    from jaxpf.points.files import grid_points

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
