"""Scores of the tracking field: success curves, and CLEAR-MOT, IDF1 and HOTA by TrackEval."""

from jaxpf.files.other_tracks import match_tracks, read_tracks
from jaxpf.measures.association import pairwise_overlap
from jaxpf.measures.scores import (
    CENTRE_THRESHOLDS,
    OVERLAP_THRESHOLDS,
    distance_precision,
    import_trackeval,
    precision_curve,
    success_area,
    success_at_half,
    success_curve,
    tracking_scores,
)

__all__ = [
    "CENTRE_THRESHOLDS",
    "OVERLAP_THRESHOLDS",
    "distance_precision",
    "import_trackeval",
    "match_tracks",
    "pairwise_overlap",
    "precision_curve",
    "read_tracks",
    "success_area",
    "success_at_half",
    "success_curve",
    "tracking_scores",
]
