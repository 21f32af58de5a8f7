"""Reads boxes from flags and MOT files; writes and draws them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.boxes.target import BOXES
from jaxpf.contract.errors import InputError
from jaxpf.targets.adapter import Adapter, Marks, starts_by_frame
from jaxpf.targets.target import Start


class BoxAdapter(Adapter):
    """See ``Adapter``."""

    target = BOXES
    example = "--box 120,80,40,90 --box 300,85,42,88"
    columns = ("x", "y", "w", "h")
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "box": {"multiple": True, "metavar": "X,Y,W,H", "help": "A start box; repeat it."},
        "boxes": {
            "type": Path,
            "help": "CSV of start boxes, such as frame,id,x,y,w,h.  With that header, or that of a "
            "tracks.csv, frames and x, y count from 0; without a header, as in MOT files, from 1.  "
            "A box in a later frame starts its object there, or puts it right.",
        },
        "ids": {"type": [int], "help": "Objects of --boxes, such as 1,2,5."},
        "births": {
            "type": Path,
            "help": "Objects come and go by detections: a MOT det.txt.  A line "
            "with an id in the place of -1 starts that object there, detected or not.",
        },
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Adapter``."""
        from jaxpf.boxes import tracks
        from jaxpf.sequences.layouts import read_truth

        if given["box"] and given["boxes"]:
            raise InputError("--box and --boxes were both given; use one of them.")
        if given["ids"] is not None and not given["boxes"]:
            raise InputError("--ids names objects of a CSV file; give the file with --boxes.")
        if given["boxes"]:
            table = read_truth(given["boxes"])
            ids, boxes = tracks.start_boxes(table, number, given["ids"])
        elif given["box"]:
            boxes = np.stack([tracks.parse_box(text) for text in given["box"]])
            ids = np.arange(1, len(boxes) + 1)
        elif given.get("births"):
            return BOXES.start(np.zeros((0, 4)))
        else:
            raise InputError(
                "no start box: give --box x,y,w,h for every object, or --boxes FILE.csv.  Draw the "
                f"start boxes with `jaxpf mark {source.path}`."
            )
        tracks.check_boxes(boxes, source.width, source.height, [f"object {i}" for i in ids])
        return BOXES.start(boxes, ids)

    def later_starts(
        self, given: Mapping[str, Any], number: int, source: Any
    ) -> tuple[dict[int, Start], str | None]:
        """See ``Adapter``: boxes of later frames in the file of --boxes."""
        from jaxpf.boxes import tracks

        if not given["boxes"]:
            return {}, None
        table = tracks.read_boxes(given["boxes"])
        ids = table.id if given["ids"] is None else given["ids"]
        named = np.isin(table.id, ids)

        def start_at(frame: int) -> Start:
            rows = named & (table.frame == frame)
            names = [f"object {i} in frame {frame}" for i in table.id[rows]]
            tracks.check_boxes(table.box[rows], source.width, source.height, names)
            return BOXES.start(table.box[rows], table.id[rows])

        return starts_by_frame(table.frame[named], table.id[named], number, start_at)

    def fits_scene(self, scene: Any) -> bool:
        """Every scene has boxes."""
        return True

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Adapter``."""
        return np.asarray(scene.boxes, np.float64)

    def scene_start(self, scene: Any) -> Start:
        """See ``Adapter``."""
        return BOXES.start(scene.boxes[0], scene.extras.get("ids"))

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """See ``Adapter``: the top left corner and the size."""
        return shapes

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Adapter``."""
        from jaxpf.media.overlay import draw_boxes

        return draw_boxes(frame, shapes, list(start.ids), marks.colours, marks.lost, marks.doubtful)


ADAPTER = BoxAdapter()
