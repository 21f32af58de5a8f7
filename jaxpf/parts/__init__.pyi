from .factory import to_parts as to_parts, tracker as tracker
from .files import Parts as Parts
from .models import (
    DEFAULT_JOINT_SCALE as DEFAULT_JOINT_SCALE,
    DEFAULT_SCALE as DEFAULT_SCALE,
    DYNAMICS as DYNAMICS,
    OfFixedSize as OfFixedSize,
    cut_pictures as cut_pictures,
    parts_model as parts_model,
    with_log_odds as with_log_odds,
)
