"""Shape spaces: how a contour may deform from its template, given or learned."""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
