"""The interface of a kind of target, and the registry of targets."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
