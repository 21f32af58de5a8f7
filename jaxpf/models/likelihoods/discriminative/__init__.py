"""Appearance learned from the start frame, as against what is around each object there."""

from jaxpf.models.likelihoods.discriminative.build import FEATURES, discriminative
from jaxpf.models.likelihoods.discriminative.exclusion import ExclusiveAppearance, excluding
from jaxpf.models.likelihoods.discriminative.likelihood import DiscriminativeLikelihood

__all__ = [
    "FEATURES",
    "DiscriminativeLikelihood",
    "ExclusiveAppearance",
    "discriminative",
    "excluding",
]
