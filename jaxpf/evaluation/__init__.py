"""Monte Carlo evaluations: many runs of several methods on one scene, stored on disk."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
