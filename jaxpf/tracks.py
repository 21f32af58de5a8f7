"""Tables of boxes and tracks, in and out."""

from jaxpf.files.tracks import (
    BoxTable,
    TrackWriter,
    check_boxes,
    dense,
    detections,
    parse_box,
    read_boxes,
    read_tracks,
    start_boxes,
    write_mot,
)

__all__ = [
    "BoxTable",
    "TrackWriter",
    "check_boxes",
    "dense",
    "detections",
    "parse_box",
    "read_boxes",
    "read_tracks",
    "start_boxes",
    "write_mot",
]
