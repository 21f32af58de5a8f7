"""Likelihoods: how well a substate explains a frame."""

from jaxpf.likelihoods.gaussian import CorrelatedGaussian, Gaussian
from jaxpf.likelihoods.histogram import (
    HistogramLikelihood,
    histogram,
    histogram_from_patches,
)

__all__ = [
    "CorrelatedGaussian",
    "Gaussian",
    "HistogramLikelihood",
    "histogram",
    "histogram_from_patches",
]
