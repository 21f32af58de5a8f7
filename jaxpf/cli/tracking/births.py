"""``jaxpf track --births``: objects that come and go by a file of detections."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.boxes.tables import BoxTable
from jaxpf.boxes.tracks import check_boxes
from jaxpf.cli.shared.flags import picked
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import options_of, plain
from jaxpf.populations.detections import DETECTED, check_frames, read_detections
from jaxpf.populations.lifetimes import Rules
from jaxpf.targets.target import Start

#: Particles for each place, unless their number is said.
PARTICLES_EACH = 100
#: A detector says where somebody is, which the picture has only to refine.
_GUIDED: Mapping[str, Any] = {"sharpness": 1.0, "scale": (6.0, 4.0, 0.02)}


class Births(NamedTuple):
    """What is known of those who come and go.

    Attributes:
        table: the file's rows.
        rules: of births and deaths.
    """

    table: BoxTable
    rules: Rules

    @property
    def watched(self) -> bool:
        """Whether the file has detections, and not only boxes that a user named."""
        return bool((self.table.id == DETECTED).any())

    @property
    def typical_size(self) -> tuple[float, float]:
        """Width and height of an object, pixels."""
        width, height = np.median(self.table.box[:, 2:], axis=0)
        return float(width), float(height)


def read_births(options: Mapping[str, Any]) -> Births | None:
    """The file of ``--births`` and its rules; None without it.

    Raises:
        InputError: a file that cannot be read, a rule without it, or a truth without TrackEval.
    """
    rules = options_of(Rules)
    if options.get("births") is None:
        for name, one in rules.items():
            if options.get(name) is not None:
                raise InputError(f"{one.flag} is about --births, which was not given.")
        return None
    if options["tracker"]:
        raise InputError(
            "--births needs a tracker with room for who may come, and --tracker may have none; "
            "leave one of them out."
        )
    births = Births(read_detections(options["births"]), picked(options, Rules))
    if not len(births.table):
        raise InputError(f"{births.table.source} holds no boxes; leave --births out.")
    _check_confidence(births)
    if options["truth"]:
        from jaxpf.measures.scores import import_trackeval

        import_trackeval()
    return births


def _check_confidence(births: Births) -> None:
    """Detectors count confidence as they like; one that leaves nobody is a mistake all the same."""
    least = births.rules.birth_confidence
    known = births.table.confidence[births.table.id == DETECTED]
    if least is not None and len(known) and known.max() < least:
        raise InputError(
            f"--birth-confidence {plain(least)} leaves out every detection of "
            f"{births.table.source}, whose confidences are from {known.min():g} to "
            f"{known.max():g}; give a lower one."
        )


def defaults_of(births: Births | None) -> tuple[dict, Mapping[str, Any]]:
    """Defaults of the filter's and of the target's options that differ with births."""
    if births is None:
        return {}, {}
    guided = births.watched and births.rules.detection_scale > 0
    particles = {"particles": PARTICLES_EACH * births.rules.capacity}
    return particles, _GUIDED if guided else {}


def check_births(births: Births, start: Start, number: int, source: Any) -> None:
    """Refuse what does not go with the video and the start.

    Raises:
        InputError: a detection in a frame that the video does not have, or outside the picture;
            somebody who starts before the start frame, or twice; more start boxes than places.
    """
    table, capacity = births.table, births.rules.capacity
    if not source.is_live and table.frame.max() >= (
        source.num_frames or source.frames_expected or 0
    ):
        # A container's word about its length is no proof.
        check_frames(table, source.num_frames or sum(1 for _ in source))
    names = [f"the detection in frame {frame}" for frame in table.frame]
    check_boxes(table.box, source.width, source.height, names)
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
        raise InputError(f"object {start.ids.min()} has a negative id; count from 0 with --births.")
    if len(start.ids) > capacity:
        raise InputError(
            f"object {start.ids[capacity]} is one more than the capacity of {capacity} objects at "
            f"once; ask for a larger --capacity, such as {plain(2 * len(start.ids))}."
        )


def by_frame(
    births: Births, start: Start, number: int
) -> tuple["Detections | None", list[tuple[int, int, np.ndarray]]]:
    """Detections of the frames from the start on, and who is named there: see ``follow``."""
    table, least = births.table, births.rules.birth_confidence
    named = [(0, int(name), box) for name, box in zip(start.ids, start.shapes, strict=True)]
    rows = zip(table.frame - number, table.id, table.box, strict=True)
    named += [(int(time), int(name), box) for time, name, box in rows if name != DETECTED]
    if not births.watched:
        return None, named
    counts = (table.id == DETECTED) & (table.confidence >= (-np.inf if least is None else least))
    return Detections(table.frame[counts] - number, table.box[counts]), named


class Detections(Sequence):
    """Boxes ``[M, 4]`` of every frame, without an end: a video may be longer than its file says."""

    def __init__(self, times: np.ndarray, boxes: np.ndarray):
        self._times, self._boxes = times, boxes

    def __getitem__(self, time: Any) -> Any:
        low, high = np.searchsorted(self._times, [time, time + 1])
        return self._boxes[low:high]

    def __len__(self) -> int:
        return int(self._times[-1]) + 1 if len(self._times) else 0
