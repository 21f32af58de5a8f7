"""Measures of tracked points against annotated landmarks.

Estimates are ``[..., T, P, 2]`` with runs on the leading axes; the truth ``[T, P, 2]`` is NaN where
unknown; ``visible`` ``[T, P]`` marks the points in view.
"""

import numpy as np
from numpy.typing import ArrayLike


def point_distances(estimates: ArrayLike, truth: ArrayLike, length: ArrayLike = 1.0) -> np.ndarray:
    """Distances ``[..., T, P]`` of points from the truth; NaN where the truth is unknown.

    Args:
        estimates: ``[..., T, P, 2]``.
        truth: ``[T, P, 2]``.
        length: ``[]`` or ``[T]``, body length; distances are relative to it (eskil2014's relative
            error).  By default distances are in pixels.
    """
    away = np.linalg.norm(np.asarray(estimates, float) - np.asarray(truth, float), axis=-1)
    length = np.asarray(length, float)
    return away / (length[:, None] if length.ndim else length)


def mean_error(distance: ArrayLike, chosen: ArrayLike | None = None) -> np.ndarray:
    """Mean known distance ``[...]`` of each run over frames and points ``chosen``, ``[T, P]``."""
    distance = np.asarray(distance, float)
    counts = ~np.isnan(distance)
    if chosen is not None:
        counts = counts & np.asarray(chosen, bool)
    number = counts.sum(axis=(-2, -1))
    total = np.where(counts, distance, 0.0).sum(axis=(-2, -1))
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def recoveries(visible: ArrayLike) -> list[tuple[int, int, int]]:
    """Occlusions that end, as (point, first hidden frame, first frame in view again).

    Occlusions from the first frame on are left out, because the point's appearance is unknown.
    """
    visible = np.asarray(visible, bool)
    occlusions = []
    for point in range(visible.shape[1]):
        shown = visible[:, point]
        begin = None
        for frame in range(1, len(shown)):
            if shown[frame - 1] and not shown[frame]:
                begin = frame
            if begin is not None and shown[frame]:
                occlusions.append((point, begin, frame))
                begin = None
    return occlusions


def points_kept(distance: ArrayLike, threshold: float) -> np.ndarray:
    """Number of points near their true position at the end of each run: ``[...]``.

    A point counts if its median distance over the last ten frames is at most ``threshold``
    (eskil2014 counts points "near their true coordinates at the end").

    Args:
        distance: ``[..., T, P]``; frames with unknown truth are left out.
        threshold: in the units of ``distance``.
    """
    distance = np.asarray(distance, float)[..., -10:, :]
    has_distance = ~np.isnan(distance)
    median = np.nanmedian(
        np.where(has_distance.any(axis=-2, keepdims=True), distance, np.inf), axis=-2
    )
    return np.sum(median <= threshold, axis=-1)
