"""Appearance learned from the start frame, by contrast with each object's surroundings."""

from jaxpf.likelihoods.discriminative.build import FEATURES, discriminative
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood

__all__ = [
    "FEATURES",
    "DiscriminativeLikelihood",
    "discriminative",
]
