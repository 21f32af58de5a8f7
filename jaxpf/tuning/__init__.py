"""Tune tracker parameters by gradient descent instead of trial and error.

Parameters are named by their path in the tracker.  Choose an objective; the result holds tuned
values and their uncertainty.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
