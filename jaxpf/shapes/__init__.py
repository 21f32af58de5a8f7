"""Shape spaces: how a contour may deform from its template, given or learned."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
