"""Monte Carlo evaluations: many runs of several methods on one scene, stored on disk."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
