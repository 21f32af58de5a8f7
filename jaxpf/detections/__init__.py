"""Track management: a varying number of objects, which start and end by detections."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
