"""Boxes joined by their overlap: candidates for birth, and the simplest tracker of all.

After SORT (Bewley et al. 2016), which joins by the best assignment, and starts and ends tracks so.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


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


def pairwise_overlap(one: ArrayLike, other: ArrayLike) -> np.ndarray:
    """Intersection over union of every pair of boxes, in double precision.

    ``jaxpf.measures.overlap`` pairs box with box in JAX; scores that compare overlaps with
    thresholds in double precision need this one to agree with other tools.

    Args:
        one: x, y, w, h ``[P, 4]``.
        other: ``[Q, 4]``.

    Returns:
        float64 ``[P, Q]``; 0 where a box is not finite or has no width or no height.
    """
    one = _proper_or_empty(one)[:, None]
    other = _proper_or_empty(other)[None, :]
    start = np.maximum(one[..., :2], other[..., :2])
    end = np.minimum(one[..., :2] + one[..., 2:], other[..., :2] + other[..., 2:])
    common = np.prod(np.maximum(end - start, 0), axis=-1)
    union = np.prod(one[..., 2:], axis=-1) + np.prod(other[..., 2:], axis=-1) - common
    return np.divide(common, union, out=np.zeros_like(common), where=union > 0)


def _proper_or_empty(boxes: ArrayLike) -> np.ndarray:
    boxes = np.asarray(boxes, np.float64).reshape(-1, 4)
    is_finite = np.isfinite(boxes).all(axis=1, keepdims=True)
    has_area = (boxes[:, 2:] > 0).all(axis=1, keepdims=True)
    return np.where(is_finite & has_area, boxes, 0)
