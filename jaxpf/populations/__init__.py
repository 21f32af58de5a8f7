"""Tracks a varying number of objects, with births and deaths from detections."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
