from .factory import to_boxes as to_boxes, tracker as tracker
from .models import (
    DEFAULT_MOMENTUM as DEFAULT_MOMENTUM,
    DEFAULT_SCALE as DEFAULT_SCALE,
    DEFAULT_STEPS as DEFAULT_STEPS,
    LONE_STEPS as LONE_STEPS,
    box_model as box_model,
    relative_box_model as relative_box_model,
    relative_steps as relative_steps,
)
from .rowe2005 import Rowe2005Settings as Rowe2005Settings, rowe2005_tracker as rowe2005_tracker
from .tracks import (
    BoxTable as BoxTable,
    check_boxes as check_boxes,
    dense as dense,
    parse_box as parse_box,
    read_boxes as read_boxes,
    read_tracks as read_tracks,
    start_boxes as start_boxes,
    to_supervision as to_supervision,
    write_mot as write_mot,
)
