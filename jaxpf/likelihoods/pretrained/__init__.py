"""Appearance by the features of a pretrained network."""

from jaxpf.likelihoods.pretrained.build import pretrained
from jaxpf.likelihoods.pretrained.likelihood import PretrainedLikelihood
from jaxpf.likelihoods.pretrained.network import EfficientNetLite0, efficientnet_lite0
from jaxpf.likelihoods.pretrained.points import PretrainedPoints, pretrained_points

__all__ = [
    "EfficientNetLite0",
    "PretrainedLikelihood",
    "PretrainedPoints",
    "efficientnet_lite0",
    "pretrained",
    "pretrained_points",
]
