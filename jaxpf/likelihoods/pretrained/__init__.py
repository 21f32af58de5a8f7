"""Appearance by the features of a pretrained network."""

from jaxpf.likelihoods.pretrained.build import pretrained
from jaxpf.likelihoods.pretrained.network import efficientnet_lite0
from jaxpf.likelihoods.pretrained.points import pretrained_points

__all__ = ["efficientnet_lite0", "pretrained", "pretrained_points"]
