"""What tuning makes large or small."""

from jaxpf.tuning.objectives import (
    crps,
    log_evidence,
    log_mean_evidence,
    outline_loss,
    overlap_loss,
    position_error,
)

__all__ = [
    "crps",
    "log_evidence",
    "log_mean_evidence",
    "outline_loss",
    "overlap_loss",
    "position_error",
]
