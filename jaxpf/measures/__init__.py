"""Measures of tracking quality: metrics, benchmark scores, intervals and matching."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
