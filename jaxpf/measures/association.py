"""Associates boxes by IoU: candidates for new objects, tracks and objects.

The optimal assignment and the rules for starting and ending tracks follow SORT (Bewley et al.
2016).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Tracks(NamedTuple):
    """The K open tracks after a frame.

    Attributes:
        ids: int ``[K]``, from 1, never reused.
        boxes: ``[K, 4]``, last detection.
        hits: int ``[K]``, number of detections.
        missed: int ``[K]``, frames since the last detection.
        next_id: id of the next new track.
    """

    ids: np.ndarray
    boxes: np.ndarray
    hits: np.ndarray
    missed: np.ndarray
    next_id: int


def no_tracks() -> Tracks:
    """The empty set of tracks before the first frame."""
    none = np.zeros(0, int)
    return Tracks(none, np.zeros((0, 4)), none, none, 1)


def assigned(one: np.ndarray, other: np.ndarray, least_iou: float) -> np.ndarray:
    """Assign each box of ``one`` ``[P, 4]`` to at most one box of ``other``: index ``[P]``, or -1.

    The assignment is one to one and maximises the sum of IoUs over pairs whose IoU is
    ``least_iou`` or more.
    """
    from scipy.optimize import linear_sum_assignment

    iou = pairwise_iou(one, other)
    iou[iou < least_iou] = 0.0
    rows, columns = linear_sum_assignment(-iou)
    partner = np.full(len(iou), -1)
    partner[rows] = np.where(iou[rows, columns] > 0, columns, -1)
    return partner


def advance(
    tracks: Tracks, detections: np.ndarray, least_iou: float = 0.3, most_missed: int = 5
) -> Tracks:
    """Update the tracks with the next frame's detections ``[M, 4]``.

    A detection continues a track at an IoU of ``least_iou``; a track survives ``most_missed``
    consecutive frames without one.
    """
    detections = np.asarray(detections, float).reshape(-1, 4)
    mine = assigned(tracks.boxes, detections, least_iou)
    seen = mine >= 0
    boxes = tracks.boxes.copy()
    boxes[seen] = detections[mine[seen]]
    missed = np.where(seen, 0, tracks.missed + 1)
    kept = missed <= most_missed
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
    """Remove the tracks at the indices ``places``."""
    kept = np.setdiff1d(np.arange(len(tracks.ids)), places)
    ids, boxes, hits, missed = (values[kept] for values in tracks[:4])
    return Tracks(ids, boxes, hits, missed, tracks.next_id)


def pairwise_iou(one: ArrayLike, other: ArrayLike) -> np.ndarray:
    """Intersection over union ``[P, Q]`` of every pair of boxes, in double precision.

    ``jaxpf.measures.iou`` compares boxes elementwise in JAX.  Scores that threshold the IoU
    need double precision to agree with other tools.  0 where a box is not finite or has no width or
    no height.
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
