"""Appearance learned from the start frame, as against what is around each object there."""

from jaxpf.likelihoods.discriminative.build import FEATURES, discriminative
from jaxpf.likelihoods.discriminative.exclusion import ExclusiveAppearance, excluding
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood

__all__ = [
    "FEATURES",
    "DiscriminativeLikelihood",
    "ExclusiveAppearance",
    "discriminative",
    "excluding",
]
