from .loop import Diverged as Diverged, tune as tune
from .metropolis import pmmh as pmmh
from .objectives import (
    crps_loss as crps_loss,
    iou_loss as iou_loss,
    log_evidence as log_evidence,
    log_mean_evidence as log_mean_evidence,
    outline_loss as outline_loss,
    position_error as position_error,
)
from .parameters import Parameter as Parameter, names as names, replace as replace
from .posterior import Posterior as Posterior
from .problem import TrainingSequence as TrainingSequence
from .result import Result as Result
from .sequences import Recipe as Recipe, training_sequence as training_sequence
from .settings import Settings as Settings
from .smc2 import Online as Online, smc2 as smc2
