"""Likelihoods of contours from edges on measurement lines, with exclusion (maccormick1999)."""

from jaxpf.likelihoods.contours.build import contours, learn_clutter, poisson_clutter
from jaxpf.likelihoods.contours.edges import EdgeDetector, Features
from jaxpf.likelihoods.contours.line_model import detection_probabilities, line_weights, log_ratio

__all__ = [
    "EdgeDetector",
    "Features",
    "contours",
    "detection_probabilities",
    "learn_clutter",
    "line_weights",
    "log_ratio",
    "poisson_clutter",
]
