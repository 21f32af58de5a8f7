"""Appearance by the features of a pretrained network."""

from jaxpf.likelihoods.pretrained.build import pretrained
from jaxpf.likelihoods.pretrained.likelihood import PretrainedLikelihood
from jaxpf.likelihoods.pretrained.network import EfficientNetLite0, efficientnet_lite0

__all__ = ["EfficientNetLite0", "PretrainedLikelihood", "efficientnet_lite0", "pretrained"]
