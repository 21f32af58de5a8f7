"""Tune tracker parameters by gradient descent instead of trial and error.

Parameters are named by their path in the tracker.  Choose an objective; the result holds tuned
values and their uncertainty.
"""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
