"""Tuning parameters of trackers by gradient descent, instead of trial and error.

Name parameters by their path in the tracker, choose an objective, and get values, their
uncertainty, and a comparison on sequences that tuning did not see.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
