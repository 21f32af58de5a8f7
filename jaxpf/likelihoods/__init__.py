"""Likelihoods: how well a substate explains a frame."""

from jaxpf.likelihoods.distance_law import learn_background
from jaxpf.likelihoods.gaussian import CorrelatedGaussian, Gaussian
from jaxpf.likelihoods.histogram import (
    HistogramLikelihood,
    histogram,
    histogram_from_patches,
)
from jaxpf.likelihoods.patch import PatchLikelihood, patch, patch_from_pictures

__all__ = [
    "CorrelatedGaussian",
    "Gaussian",
    "HistogramLikelihood",
    "PatchLikelihood",
    "histogram",
    "histogram_from_patches",
    "learn_background",
    "patch",
    "patch_from_pictures",
]
