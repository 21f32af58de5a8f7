"""Track management: when to start tracking a detected object, and when to stop.

They do not depend on the tracker: they use only the boxes it reports and the detections of the
frame.  Slots are reused, ids never.
"""

import dataclasses
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from jaxpf.contract.options import Option, check_fields
from jaxpf.measures import association
from jaxpf.measures.association import pairwise_iou

#: The id of an empty slot, and of an object without an id.
EMPTY = -1
#: Largest number of objects at once.
MOST_AT_ONCE = 4096
#: Maximum number of consecutive frames without a detection that a candidate survives.
_MOST_MISSED = 2
#: Candidates with a larger IoU are duplicates of one object.
_TWICE = 0.5


@dataclasses.dataclass(frozen=True)
class Rules:
    """Options of ``--detections``, those of SORT by its names; see the help of each."""

    capacity: Annotated[
        int, Option("Maximum number of objects at once.", least=1, most=MOST_AT_ONCE)
    ] = 16
    min_hits: Annotated[
        int, Option("A new object starts after this number of detections.", least=1)
    ] = 3
    detection_iou: Annotated[
        float,
        Option(
            "Minimum intersection over union between a detection and the object, or "
            "the earlier detection, that it belongs to.",
            above=0,
            most=1,
        ),
    ] = 0.1
    detection_confidence: Annotated[
        float | None, Option("Ignore detections of lower confidence.")
    ] = None
    detection_interval: Annotated[
        int | None,
        Option(
            "The detector ran on every N-th frame.  Objects neither start nor end on "
            "the frames between.  By default N follows from the frames of the detections.",
            least=1,
        ),
    ] = None
    max_age: Annotated[
        int,
        Option(
            "Maximum number of consecutive frames without a detection (frames in which the "
            "detector did not run are skipped), or without likelihood; an object ends in the next.",
            least=0,
        ),
    ] = 5
    detection_noise: Annotated[
        float,
        Option(
            "Standard deviation of a detection's error, as a share of the object's "
            "size.  With 0, detections start and end objects but do not guide their positions.",
            least=0,
        ),
    ] = 0.1

    def __post_init__(self) -> None:
        check_fields(self)


class Living(NamedTuple):
    """The tracked objects after a frame, in C slots.

    Attributes:
        ids: int ``[C]``, ``EMPTY`` for an empty slot.
        unseen: int ``[C]``, consecutive frames without a detection, or without likelihood.
        undetected: int ``[C]``, consecutive frames in which the detector did not find it.
        candidates: tracks of detections that belong to no tracked object.
        last_id: the largest id assigned; the next object gets the next number.
    """

    ids: np.ndarray
    unseen: np.ndarray
    undetected: np.ndarray
    candidates: association.Tracks
    last_id: int


class Change(NamedTuple):
    """An object that starts, ends, or could not start: where, and why.

    Attributes:
        id: of the object; ``EMPTY`` for a detection that could not start.
        slot: ``EMPTY`` if it could not start.
        box: where it starts or could not; None if it ended.
        reason: "" if it starts.
    """

    id: int
    slot: int = EMPTY
    box: Any = None
    reason: str = ""


class Changes(NamedTuple):
    """Objects that started, ended or were refused in a frame."""

    started: list[Change]
    ended: list[Change]
    refused: list[Change]


def start_empty(capacity: int, last_id: int = 0) -> Living:
    """Return the state before the first frame; ids up to ``last_id`` are reserved."""
    none = np.zeros(capacity, int)
    return Living(np.full(capacity, EMPTY), none, none, association.no_tracks(), last_id)


def advance(
    living: Living,
    boxes: np.ndarray,
    without_likelihood: np.ndarray,
    detections: np.ndarray | None,
    named: Sequence[tuple[int, np.ndarray]],
    frame_shape: Sequence[int],
    rules: Rules,
) -> tuple[Living, Changes]:
    """End and start objects after a frame.

    Args:
        living: the state after the previous frame.
        boxes: ``[C, 4]``, the tracker's current boxes; rows of empty slots are ignored.
        without_likelihood: ``[C]`` bool, no particle had any likelihood.
        detections: ``[M, 4]`` of the frame; None if no detector ran, so that an object without a
            detection counts neither as unseen nor as undetected.
        named: id and box of objects that the user starts in this frame, detected or not.
        frame_shape: height and width of the frame.
        rules: see ``Rules``.
    """
    unseen, undetected, ended = _find_ended(
        living, boxes, without_likelihood, detections, frame_shape, rules
    )
    ids, candidates, last_id = living.ids.copy(), living.candidates, living.last_id
    ids[[gone.slot for gone in ended]] = EMPTY
    wanted: list[tuple[int, np.ndarray]] = list(named)
    refused: list[Change] = []
    full = f"all places, {len(ids)}, are taken; ask for a larger capacity."
    if detections is not None:
        here = np.concatenate([boxes[ids != EMPTY], *(box[None] for _, box in named)])
        is_tracked = pairwise_iou(detections, here).max(axis=1, initial=0) >= rules.detection_iou
        limits = rules.detection_iou, _MOST_MISSED
        candidates = association.advance(candidates, detections[~is_tracked], *limits)
        ready = (candidates.hits >= rules.min_hits) & (candidates.missed == 0)
        ready &= _inside(candidates.boxes, frame_shape)
        ready &= _first_of_each(candidates.boxes, ready)
        room = max(np.sum(ids == EMPTY) - len(named), 0)
        born, late = np.split(np.flatnonzero(ready), [room])
        wanted += [(EMPTY, candidates.boxes[place]) for place in born]
        # Report a refusal once; the candidate stays and starts as soon as a slot is free.
        first = late[candidates.hits[late] == rules.min_hits]
        refused = [Change(EMPTY, box=box, reason=full) for box in candidates.boxes[first]]
        candidates = association.without(candidates, born)
    started = []
    for identity, box in wanted:
        free = np.flatnonzero(ids == EMPTY)
        if len(free) == 0:
            refused.append(Change(identity, box=box, reason=full))
            continue
        if identity == EMPTY:
            identity = last_id = last_id + 1
        ids[free[0]], unseen[free[0]], undetected[free[0]] = identity, 0, 0
        started.append(Change(identity, int(free[0]), box))
    living = Living(ids, unseen, undetected, candidates, last_id)
    return living, Changes(started, ended, refused)


def _find_ended(
    living: Living,
    boxes: np.ndarray,
    without_likelihood: np.ndarray,
    detections: np.ndarray | None,
    frame_shape: Sequence[int],
    rules: Rules,
) -> tuple[np.ndarray, np.ndarray, list[Change]]:
    """Return each slot's unseen and undetected frames in a row ``[C]``, and who ended."""
    alive = living.ids != EMPTY
    seen, undetected = ~without_likelihood, living.undetected.copy()
    if detections is not None:
        detected = association.assigned(boxes[alive], detections, rules.detection_iou) >= 0
        seen[alive] &= detected
        undetected[alive] = np.where(detected, 0, undetected[alive] + 1)
    unseen = np.where(alive & ~seen, living.unseen + 1, 0)
    outside = alive & ~_inside(boxes, frame_shape)
    forgotten = alive & (np.maximum(unseen, undetected) > rules.max_age)
    cause = "without likelihood" if detections is None else "not detected, or without likelihood,"
    row = f"{rules.max_age + 1} frames"

    def reason(slot: int) -> str:
        if outside[slot]:
            return "left the picture"
        if unseen[slot] > rules.max_age:
            return f"{cause} in {row} in a row"
        return f"not detected in {row} with detections in a row"

    gone = np.flatnonzero(outside | forgotten).tolist()
    ended = [Change(int(living.ids[slot]), slot, reason=reason(slot)) for slot in gone]
    return unseen, undetected, ended


def _first_of_each(boxes: np.ndarray, ready: np.ndarray) -> np.ndarray:
    """``[K]`` bool: ready, and not a duplicate of an earlier candidate that is ready."""
    first = np.zeros(len(boxes), bool)
    for place in np.flatnonzero(ready):
        apart = pairwise_iou(boxes[[place]], boxes[first])
        first[place] = apart.max(initial=0) <= _TWICE
    return first


def _inside(boxes: np.ndarray, frame_shape: Sequence[int]) -> np.ndarray:
    """``[K]`` bool: the centre of the box lies in the frame."""
    middle = boxes[:, :2] + boxes[:, 2:] / 2
    return np.all((middle >= 0) & (middle < np.array(frame_shape[1::-1])), axis=1)
