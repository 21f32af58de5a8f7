"""Reads parts of articulated objects from files; writes and draws them."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.parts.target import PARTS, Parts
from jaxpf.targets.adapter import Adapter, Marks
from jaxpf.targets.target import Start


class PartAdapter(Adapter):
    """See ``Adapter``."""

    target = PARTS
    example = "--parts-file parts.csv"
    columns = ("x", "y", "w", "h", "angle")
    fixed_columns = ("w", "h")
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "parts_file": {
            "type": Path,
            "help": "CSV of the parts of one or several articulated objects, with the header "
            "part,parent,x,y,w,h,angle (x, y: centre; angle: degrees clockwise; leave parent empty "
            "for each object's root).",
        }
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Adapter``."""
        from jaxpf.parts.files import read_parts

        path = given["parts_file"]
        if path is None:
            raise InputError(
                "no parts: give --parts-file FILE.csv.  Draw parts with "
                f"`jaxpf mark {source.path} --target parts`."
            )
        parts = read_parts(path)
        for name, (x, y, _) in zip(parts.names, parts.poses, strict=True):
            if not (0 <= x < source.width and 0 <= y < source.height):
                raise InputError(
                    f"part '{name}' of '{path}' has its centre ({x:g},{y:g}) outside the "
                    f"{source.width}x{source.height} frame; give x and y of the centre, in pixels."
                )
        return PARTS.start(parts)

    def fits_scene(self, scene: Any) -> bool:
        """Whether the ground truth has poses and a part tree."""
        return {"poses", "parents"} <= set(scene.extras)

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Adapter``."""
        return np.asarray(scene.extras["poses"], np.float64)

    def scene_start(self, scene: Any) -> Start:
        """See ``Adapter``."""
        parents = tuple(int(parent) for parent in scene.extras["parents"])
        ids = scene.extras.get("ids", range(1, len(parents) + 1))
        return PARTS.start(Parts(tuple(ids), parents, scene.extras["poses"][0], scene.sizes))

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """See ``Adapter``."""
        sizes = start.sizes * np.sqrt(np.prod(factors))
        return dataclasses.replace(start, sizes=sizes), shapes * np.array([*factors, 1.0])

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """See ``Adapter``: centre, size and clockwise angle in degrees."""
        sizes = np.broadcast_to(start.sizes, (*shapes.shape[:-1], 2))
        return np.concatenate([shapes[..., :2], sizes, np.rad2deg(shapes[..., 2:3])], axis=-1)

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Adapter``."""
        from jaxpf.media.overlay import draw_outlines

        corners = np.asarray(PARTS.outlines(start, np.asarray(shapes)), float)
        lines = np.concatenate([corners, corners[:, :1]], axis=1)
        return draw_outlines(frame, lines, start.ids, marks.colours, marks.lost, marks.doubtful)


ADAPTER = PartAdapter()
