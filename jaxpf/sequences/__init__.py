"""Recorded sequences and their annotations: one reader for every program."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
