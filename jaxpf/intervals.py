"""Means and shares with confidence intervals."""

from jaxpf.measures.intervals import (
    Interval,
    as_float,
    masked_mean,
    mean_interval,
    student_interval,
    student_quantile,
    wilson_interval,
)

__all__ = [
    "Interval",
    "as_float",
    "masked_mean",
    "mean_interval",
    "student_interval",
    "student_quantile",
    "wilson_interval",
]
