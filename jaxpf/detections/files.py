"""Reads and writes detections: MOT ``det.txt`` files, which may also contain start boxes.

A row with id -1 is a detection.  A row with an id of at least 1 comes from the user: that object
starts in that frame, at that box.
"""

import os
from collections.abc import Sequence

import numpy as np

from jaxpf.boxes.tracks import write_mot
from jaxpf.contract.errors import InputError
from jaxpf.detections.lifetimes import Rules
from jaxpf.sequences.tables import BoxTable, box_rows, table_of

#: The id of a detection.
DETECTED = -1


class Detections(dict[int, np.ndarray | None]):
    """Boxes ``[M, 4]`` by frame, as ``follow`` takes them; None where the detector did not run.

    Attributes:
        counted: which rows of the table are detections that are confident enough, bool.
        every: the detector's step in frames: as the rules say, else the largest step shared by all
            frames with detections; 1 if these are fewer than three, which determine no step.
    """

    def __init__(self, table: BoxTable, rules: Rules):
        """Take the detections of a table, which has at least one."""
        least, detected = rules.detection_confidence, table.id == DETECTED
        self.counted = detected & (table.confidence >= (-np.inf if least is None else least))
        frames = np.unique(table.frame[detected])
        step = int(np.gcd.reduce(np.diff(frames))) if len(frames) > 2 else 1
        self.every, self._first = rules.detection_interval or step, int(frames[0])
        rows = self.counted & ((table.frame - self._first) % self.every == 0)
        ran = np.unique(table.frame[rows]).tolist()
        super().__init__({at: table.box[rows & (table.frame == at)] for at in ran})

    def __missing__(self, number: int) -> np.ndarray | None:
        return None if (number - self._first) % self.every else np.zeros((0, 4))


def read_detections(path: str | os.PathLike[str]) -> BoxTable:
    """Read a ``det.txt``: ``frame,-1,x,y,w,h,conf,...`` in MOT format; returns it by frame.

    Args:
        path: see ``jaxpf.boxes.read_boxes``; a header is accepted, too.

    Raises:
        InputError: a line is unreadable, its id is 0 or below -1, or it starts an object a second
            time; the message names the line.
    """
    rows: list[tuple[float, ...]] = []
    started: dict[int, int] = {}
    for line, row in box_rows(path):
        identity, place = int(row[1]), f"line {line} of '{path}'"
        if identity < 1 and identity != DETECTED:
            raise InputError(
                f"{place} has the id {identity}; write {DETECTED} for a detection, or the number "
                "from 1 on of an object that starts there"
            )
        if min(row[4:6]) == 0:
            continue
        if identity in started:
            raise InputError(
                f"{place} starts object {identity} again, as line {started[identity]} does; keep "
                f"one of the two, and write the id {DETECTED} for detections"
            )
        if identity != DETECTED:
            started[identity] = line
        rows.append(row)
    return table_of(sorted(rows, key=lambda row: row[0]), path)


def write_detections(path: str | os.PathLike[str], detections: Sequence[np.ndarray]) -> None:
    """Write the boxes ``[M, 4]`` of every frame as a ``det.txt``."""
    numbers = [len(boxes) for boxes in detections]
    boxes = np.concatenate([np.reshape(boxes, (-1, 4)) for boxes in detections])
    frames = np.repeat(np.arange(len(detections)), numbers)
    write_mot(path, frames, np.full(len(boxes), DETECTED), boxes)
