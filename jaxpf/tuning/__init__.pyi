from .objectives import (
    crps_loss as crps_loss,
    iou_loss as iou_loss,
    log_evidence as log_evidence,
    outline_loss as outline_loss,
    position_error as position_error,
)
from .parameters import replace as replace
from .problem import TrainingSequence as TrainingSequence
from .sequences import Recipe as Recipe, training_sequence as training_sequence
from .settings import Settings as Settings
from .smc2 import smc2 as smc2
