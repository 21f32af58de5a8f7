"""Appearance learned from the start frame, by contrast with each object's surroundings."""

from jaxpf.likelihoods.discriminative.build import discriminative

__all__ = ["discriminative"]
