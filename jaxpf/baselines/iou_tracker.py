"""Detections joined into tracks by their overlap: the simplest tracker of many objects.

After Bochinski, Eiselein and Sikora, "High-speed tracking-by-detection without using image
information" (2017), with the best assignment in the place of a greedy one, and with the rules by
which SORT (Bewley et al. 2016) starts and ends tracks: a track counts from its ``least_hits``-th
detection on, and ends when ``most_missed`` frames in a row had none.  It looks at no picture and
predicts no motion.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from jaxpf.errors import InputError
from jaxpf.measures.track_matching import pairwise_overlap


class Rules(NamedTuple):
    """When a detection continues a track, and when a track counts.

    Attributes:
        least_overlap: intersection over union from which it does, in (0, 1].
        least_hits: detections after which a track is reported.
        most_missed: frames in a row without a detection that a track survives.
        missed: ``"skip"`` reports a track where it has a detection only, ``"hold"`` its last box
            also where it has none.
    """

    least_overlap: float = 0.3
    least_hits: int = 3
    most_missed: int = 5
    missed: str = "skip"


class Tracks(NamedTuple):
    """The tracks that are open after a frame, K of them.

    Attributes:
        ids: int ``[K]``, from 1, never used twice.
        boxes: ``[K, 4]``, the last detection of each.
        hits: int ``[K]``, its detections so far.
        missed: int ``[K]``, frames since the last.
        next_id: of the next track.
    """

    ids: np.ndarray
    boxes: np.ndarray
    hits: np.ndarray
    missed: np.ndarray
    next_id: int


def no_tracks() -> Tracks:
    """Before the first frame."""
    none = np.zeros(0, int)
    return Tracks(none, np.zeros((0, 4)), none, none, 1)


def assigned(one: np.ndarray, other: np.ndarray, least_overlap: float) -> np.ndarray:
    """Which box of ``other`` ``[Q, 4]`` belongs to each of ``one`` ``[P, 4]``, at most one to one.

    The assignment with the largest sum of overlaps among pairs that overlap by ``least_overlap``
    or more; int ``[P]``, -1 for none.
    """
    from scipy.optimize import linear_sum_assignment

    overlap = pairwise_overlap(one, other)
    overlap[overlap < least_overlap] = 0.0
    rows, columns = linear_sum_assignment(-overlap)
    found = np.full(len(overlap), -1)
    found[rows] = np.where(overlap[rows, columns] > 0, columns, -1)
    return found


def advance(tracks: Tracks, detections: np.ndarray, rules: Rules) -> Tracks:
    """The tracks after another frame, whose detections are ``[M, 4]``."""
    detections = np.asarray(detections, float).reshape(-1, 4)
    mine = assigned(tracks.boxes, detections, rules.least_overlap)
    seen = mine >= 0
    boxes = tracks.boxes.copy()
    boxes[seen] = detections[mine[seen]]
    missed = np.where(seen, 0, tracks.missed + 1)
    kept = missed <= rules.most_missed
    fresh = detections[np.setdiff1d(np.arange(len(detections)), mine)]
    number = len(fresh)
    return Tracks(
        ids=np.concatenate([tracks.ids[kept], tracks.next_id + np.arange(number)]),
        boxes=np.concatenate([boxes[kept], fresh]),
        hits=np.concatenate([(tracks.hits + seen)[kept], np.ones(number, int)]),
        missed=np.concatenate([missed[kept], np.zeros(number, int)]),
        next_id=tracks.next_id + number,
    )


def without(tracks: Tracks, places: np.ndarray) -> Tracks:
    """The tracks but for those at some places."""
    kept = np.setdiff1d(np.arange(len(tracks.ids)), places)
    ids, boxes, hits, missed = (values[kept] for values in tracks[:4])
    return Tracks(ids, boxes, hits, missed, tracks.next_id)


def iou_tracks(detections: Iterable[np.ndarray], rules: Rules | None = None) -> np.ndarray:
    """Follow whatever is detected.

    Args:
        detections: of every frame, boxes ``[M, 4]``: x, y, w, h in pixels.
        rules: default ``Rules()``.

    Returns:
        ``[T, K, 4]``, one column for each track that was ever reported, in the order of their ids;
        NaN where it is not.

    Raises:
        InputError: a rule out of range.
    """
    rules = rules or Rules()
    check_rules(rules)
    tracks, reported = no_tracks(), []
    for frame in detections:
        tracks = advance(tracks, frame, rules)
        shown = tracks.hits >= rules.least_hits
        if rules.missed == "skip":
            shown &= tracks.missed == 0
        reported.append((tracks.ids[shown], tracks.boxes[shown]))
    return in_columns(reported)


def in_columns(reported: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """``[T, K, 4]`` of the ids ``[P]`` and boxes ``[P, 4]`` of every frame, K ids in ascending
    order, NaN where an id has no box; what ``jaxpf.scores.tracking_scores`` takes."""
    every = np.unique(np.concatenate([ids for ids, _ in reported] or [np.zeros(0, int)]))
    boxes = np.full((len(reported), len(every), 4), np.nan)
    for row, (ids, found) in zip(boxes, reported, strict=True):
        row[np.searchsorted(every, ids)] = found
    return boxes


def check_rules(rules: Rules) -> None:
    """Refuse rules that no track can keep.

    Raises:
        InputError: which one.
    """
    if not 0 < rules.least_overlap <= 1:
        raise InputError(f"least_overlap={rules.least_overlap} must be above 0 and at most 1.")
    if rules.least_hits < 1 or rules.most_missed < 0:
        raise InputError(
            f"least_hits={rules.least_hits} must be at least 1, and "
            f"most_missed={rules.most_missed} at least 0."
        )
    if rules.missed not in ("skip", "hold"):
        raise InputError(f"missed={rules.missed!r} is unknown; choose one of skip, hold.")
