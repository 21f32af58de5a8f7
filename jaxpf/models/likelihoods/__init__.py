"""Likelihoods: how well a substate explains a frame."""

from jaxpf.models.likelihoods.discriminative import (
    DiscriminativeLikelihood,
    ExclusiveAppearance,
    discriminative,
    excluding,
)
from jaxpf.models.likelihoods.distance_law import learn_background
from jaxpf.models.likelihoods.gaussian import CorrelatedGaussian, Gaussian
from jaxpf.models.likelihoods.histogram import (
    HistogramLikelihood,
    histogram,
    histogram_from_patches,
)
from jaxpf.models.likelihoods.patch import PatchLikelihood, patch, patch_from_pictures
from jaxpf.models.likelihoods.pixels import PixelLikelihood, pixels
from jaxpf.models.likelihoods.windows import WindowLikelihood, windows

__all__ = [
    "CorrelatedGaussian",
    "DiscriminativeLikelihood",
    "ExclusiveAppearance",
    "Gaussian",
    "HistogramLikelihood",
    "PatchLikelihood",
    "PixelLikelihood",
    "WindowLikelihood",
    "discriminative",
    "excluding",
    "histogram",
    "histogram_from_patches",
    "learn_background",
    "patch",
    "patch_from_pictures",
    "pixels",
    "windows",
]
