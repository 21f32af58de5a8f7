"""Likelihoods: how well a substate explains a frame."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
