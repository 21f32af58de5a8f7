"""Detections joined into tracks by their overlap: the simplest tracker of many objects.

After Bochinski, Eiselein and Sikora, "High-speed tracking-by-detection without using image
information" (2017), with the best assignment in the place of a greedy one, and with the rules by
which SORT (Bewley et al. 2016) starts and ends tracks: a track counts from its ``least_hits``-th
detection on, and ends when ``most_missed`` frames in a row had none.  It looks at no picture and
predicts no motion.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from jaxpf.contract.errors import InputError, check_known
from jaxpf.measures.association import Rules, advance, no_tracks


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
    order, NaN where an id has no box; what ``jaxpf.measures.tracking_scores`` takes."""
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
    check_known("missed=", rules.missed, ("skip", "hold"))
