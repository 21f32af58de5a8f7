from .factory import to_boxes as to_boxes, tracker as tracker
from .tracks import (
    read_boxes as read_boxes,
    read_tracks as read_tracks,
    to_supervision as to_supervision,
)
