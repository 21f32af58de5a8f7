"""What runs record, and how far answers lie from the truth."""

import jax
import numpy as np


def everything(state, summary):
    """Record states and summaries."""
    return state, summary


def only_evidence(state, summary):
    """Record the evidence alone."""
    return summary.log_evidence


def only_estimate(state, summary):
    """Record the estimates alone."""
    return summary.estimate


def z_score(values, truth):
    """Distance of the mean of values ``[R, ...]`` from the truth, in standard errors."""
    return np.abs(values.mean(axis=0) - truth) / (values.std(axis=0) / len(values) ** 0.5)


def assert_equal(one, other):
    """The same trees, to the bit."""
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)
