"""Particle filters: partitioned, labelled and factored, with uncertainty estimates."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
