"""IOU tracker: joins detections into tracks by overlap, without images or a motion model.

After Bochinski, Eiselein and Sikora, "High-speed tracking-by-detection without using image
information" (2017), but with an optimal assignment instead of a greedy one, and with SORT's rules
(Bewley et al. 2016) for starting and ending tracks: a track is reported from its
``least_hits``-th detection and survives at most ``most_missed`` frames in a row without one.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from jaxpf.contract.errors import InputError, check_known
from jaxpf.measures.association import Rules, advance, no_tracks


def iou_tracks(detections: Iterable[np.ndarray], rules: Rules | None = None) -> np.ndarray:
    """Join detections into tracks.

    Args:
        detections: per frame, boxes ``[M, 4]``: x, y, w, h in pixels.
        rules: ``Rules()`` by default.

    Returns:
        ``[T, K, 4]``, one column per reported track in ascending order of ids; NaN where a track is
        not reported.
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
    """Arrange the ids ``[P]`` and boxes ``[P, 4]`` of every frame as ``[T, K, 4]``.

    The K ids are in ascending order; NaN where an id has no box.  This is the input format of
    ``jaxpf.measures.tracking_scores``.
    """
    every = np.unique(np.concatenate([ids for ids, _ in reported] or [np.zeros(0, int)]))
    boxes = np.full((len(reported), len(every), 4), np.nan)
    for row, (ids, found) in zip(boxes, reported, strict=True):
        row[np.searchsorted(every, ids)] = found
    return boxes


def check_rules(rules: Rules) -> None:
    """Raise ``InputError`` if a rule is out of range."""
    if not 0 < rules.least_overlap <= 1:
        raise InputError(f"least_overlap={rules.least_overlap} must be above 0 and at most 1.")
    if rules.least_hits < 1 or rules.most_missed < 0:
        raise InputError(
            f"least_hits={rules.least_hits} must be at least 1, and "
            f"most_missed={rules.most_missed} at least 0."
        )
    check_known("missed=", rules.missed, ("skip", "hold"))
