"""Likelihoods of contours from edges on measurement lines, with exclusion (maccormick1999)."""

from jaxpf.likelihoods.contours.build import EXCLUSIONS, contours
from jaxpf.likelihoods.contours.clutter import learn_clutter, lost_tail, poisson_clutter
from jaxpf.likelihoods.contours.edges import EdgeDetector, Features, Lines
from jaxpf.likelihoods.contours.exclusive import ExclusiveContours, OpaqueContours
from jaxpf.likelihoods.contours.likelihood import IndependentContours
from jaxpf.likelihoods.contours.line_model import detection_probabilities, line_weights, log_ratio

__all__ = [
    "EXCLUSIONS",
    "EdgeDetector",
    "ExclusiveContours",
    "Features",
    "IndependentContours",
    "Lines",
    "OpaqueContours",
    "contours",
    "detection_probabilities",
    "learn_clutter",
    "line_weights",
    "log_ratio",
    "lost_tail",
    "poisson_clutter",
]
