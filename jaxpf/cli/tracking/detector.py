"""``jaxpf track --detections``: objects that come and go, from a file of detections."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxpf.boxes.target import BOXES
from jaxpf.boxes.tracks import check_boxes
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import parse
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import options_of
from jaxpf.detections.files import DETECTED, Detections, check_frames, read_detections
from jaxpf.detections.lifetimes import Rules
from jaxpf.measures.scores import import_trackeval
from jaxpf.media.film import FrameSource
from jaxpf.sequences.tables import BoxTable
from jaxpf.targets.target import Start

#: Default number of particles per place.
PARTICLES_EACH = 100
#: Model options with a detector.  It finds the objects; the image only refines their positions.
_GUIDED: Mapping[str, Any] = {"sharpness": 1.0, "noise_pixels": (6.0, 4.0, 0.02)}


class Detector(NamedTuple):
    """Detections and rules for objects that come and go.

    Attributes:
        table: rows of the file.
        rules: rules of starts and ends.
        by_frame: the detections; None if the file has only boxes with ids.
    """

    table: BoxTable
    rules: Rules
    by_frame: Detections | None

    @property
    def defaults(self) -> dict[str, Any]:
        """Defaults of filter and target options that differ with --detections."""
        guided = self.by_frame is not None and self.rules.detection_noise > 0
        return {
            "num_particles": PARTICLES_EACH * self.rules.capacity,
            **(_GUIDED if guided else {}),
        }

    @property
    def typical_size(self) -> tuple[float, float]:
        """Width and height of a typical object, pixels."""
        width, height = np.median(self.table.box[:, 2:], axis=0)
        return float(width), float(height)

    def starts(self, start: Start, number: int) -> tuple[Start, dict[int, Start]]:
        """Start boxes and those of the file's rows with ids: in frame ``number``, and later."""
        named = self.table.id != DETECTED
        rows = {
            int(frame): named & (self.table.frame == frame) for frame in self.table.frame[named]
        }
        later = {
            at: BOXES.start(self.table.box[own], self.table.id[own]) for at, own in rows.items()
        }
        if (here := later.pop(number, None)) is not None:
            boxes = np.concatenate([start.shapes, here.shapes])
            start = BOXES.start(boxes, np.concatenate([start.ids, here.ids]))
        return start, later


def read_detector(options: Mapping[str, Any]) -> Detector | None:
    """Read the file of ``--detections`` and its rules; None without ``--detections``."""
    if options.get("detections") is None:
        for name, rule in options_of(Rules).items():
            if options.get(name) is not None:
                raise InputError(
                    f"{rule.flag} works only with --detections; add it, or leave {rule.flag} out."
                )
        return None
    table, rules = read_detections(options["detections"]), Rules(**parse(options, Rules))
    if not len(table):
        raise InputError(
            f"{table.source} holds no boxes; give a file with detections, or leave "
            "--detections out."
        )
    detected = table.id == DETECTED
    by_frame = Detections(table, rules) if detected.any() else None
    if by_frame is not None and not by_frame.counted.any():
        confidences = table.confidence[detected]
        raise InputError(
            f"--detection-confidence {plain(rules.detection_confidence)} leaves out every "
            f"detection of {table.source}, whose confidences are from {confidences.min():g} to "
            f"{confidences.max():g}; give a lower one."
        )
    if options["truth"]:
        import_trackeval()
    return Detector(table, rules, by_frame)


def check_detector(detector: Detector, start: Start, number: int, source: FrameSource) -> None:
    """Check detections and start boxes against the video."""
    table, capacity = detector.table, detector.rules.capacity
    if not source.is_live and table.frame.max() >= (
        source.num_frames or source.frames_expected or 0
    ):
        # The length in the container may be wrong.
        check_frames(table, source.num_frames or sum(1 for _ in source))
    named = table.id != DETECTED
    names = [f"the object that starts in frame {frame}" for frame in table.frame[named]]
    check_boxes(table.box[named], source.width, source.height, names)
    low, size = table.box[~named, :2], [source.width, source.height]
    outside = np.any((low >= size) | (low + table.box[~named, 2:] <= 0), axis=1)
    if outside.any():
        say(
            f"Note: {outside.sum()} of {len(outside)} detections of {table.source} lie outside the "
            "picture and are left out.",
            err=True,
        )
    for frame, identity in zip(table.frame, table.id, strict=True):
        if identity != DETECTED and frame < number:
            raise InputError(
                f"{table.source} starts object {identity} in frame {frame}, and tracking starts "
                f"with frame {number} (counting from 0); shift one of them."
            )
        if identity in start.ids:
            raise InputError(
                f"{table.source} starts object {identity}, which has a start box already; give it "
                "another number."
            )
    if np.any(start.ids < 0):
        raise InputError(
            f"object {start.ids.min()} has a negative id; count from 0 with --detections."
        )
    if len(start.ids) > capacity:
        raise InputError(
            f"object {start.ids[capacity]} is one more than the capacity of {capacity} objects at "
            f"once; ask for a larger --capacity, such as {plain(2 * len(start.ids))}."
        )


def why_none_started(detector: Detector, start: int) -> str:
    """Explain from the detections why no object started."""
    (table, rules, by_frame), frames = detector, np.zeros(0)
    if by_frame is not None:
        frames = np.unique(table.frame[by_frame.counted & (table.frame >= start)])
    if by_frame is None or len(frames) < rules.min_hits:
        return (
            f"no object started: it must be detected {rules.min_hits} times, and "
            f"{table.source} has detections in {len(frames)} of the frames from {start} on; lower "
            "--min-hits, or give more detections."
        )
    return (
        f"no object started: none was detected {rules.min_hits} times inside the picture with "
        f"an IoU of {rules.detection_iou:g} or more from one detection to the next (the "
        f"detector's step is {by_frame.every} frame(s)); lower --detection-iou or --min-hits, or "
        "correct --detection-interval."
    )
