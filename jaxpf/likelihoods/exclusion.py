"""Exclusion between boxes: pixels that one object explains do not count for another.

A likelihood that factors lets the same pixels support several objects, so the boxes of look-alikes
attract each other.  Here, one object of every pair is in front, each with probability one half.
Where the front box covers the other box, the pixels show the front object, and the other object
explains them no better than background does.  With l the log-likelihood of an object alone,
relative to background, and c_ij the share of box j that box i takes::

    log p(y | x) = sum_i l_i + sum_(i<j) log((exp(-c_ij l_j) + exp(-c_ji l_i)) / 2)

A box is larger than its object, and a half-hidden object still shows its other half.  So box i
takes nothing of box j while it covers less than 70% of it, everything from 95% on, and a
proportional share in between.  Boxes side by side are evaluated as without exclusion.  Of two
boxes in one place only the one that looks more like its object counts: a hidden object costs
nothing, and a box on a look-alike's image gains nothing.  For two objects this is a mixture of two
normalised densities wherever ``exp(l)`` is a ratio of densities; for more it is the product over
pairs.
"""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood
from jaxpf.likelihoods.pretrained.likelihood import PretrainedLikelihood
from jaxpf.shapes.rectangles import area, boxes_from_substates, intersection_area

#: Covered share of a box up to which nothing is taken, and from which everything is.
_TAKEN = 0.7, 0.95


class _Exclusive:
    """Objects of boxes ``sizes`` that exclude each other.

    Each object's own log-likelihood is the weighting function of partitioned sampling.  With
    ``joint_weighting``, each object is weighted jointly with the expected states of the others.
    """

    sizes: Any

    def log_joint(self, observation, substates, log_probs):
        """Log-likelihood ``[]`` of all objects' substates ``[P, D]`` together."""
        return self.log_joint_all(observation, substates[..., None], log_probs[..., None])[0]

    def log_joint_all(self, observation, substates, log_probs):
        """The same for N particles, ``[N]``: ``substates [P, D, N]``, ``log_probs [P, N]``."""
        sizes = jnp.asarray(self.sizes, substates.dtype)
        boxes = boxes_from_substates(jnp.moveaxis(substates, -1, 0), sizes).swapaxes(0, 1)
        shared = intersection_area(boxes[:, None], boxes[None])
        covered = shared / jnp.maximum(area(boxes), 1e-6)[None]  # [i, j, N]: of j, by i
        least, most = _TAKEN
        taken = jnp.clip((covered - least) / (most - least), 0, 1)
        # An impossible box loses nothing here; its -inf enters with the sum of ``log_probs``.
        own = jnp.where(jnp.isneginf(log_probs), 0.0, log_probs)
        lost = taken * own[None]
        either = jnp.logaddexp(-lost, -jnp.swapaxes(lost, 0, 1)) - math.log(2.0)
        is_pair = np.triu(np.ones(shared.shape[:2], bool), 1)
        pairs = jnp.sum(jnp.where(is_pair[..., None], either, 0.0), axis=(0, 1))
        return jnp.sum(log_probs, axis=0) + pairs


@pytree_dataclass
class ExclusiveAppearance(_Exclusive, DiscriminativeLikelihood):
    """Learned appearance of objects that exclude each other; make one with :func:`excluding`."""


@pytree_dataclass
class ExclusivePretrained(_Exclusive, PretrainedLikelihood):
    """The same by a network's features; make one with :func:`excluding`."""


def excluding(
    likelihood: DiscriminativeLikelihood | PretrainedLikelihood,
) -> ExclusiveAppearance | ExclusivePretrained:
    """The same learned appearance, of objects that exclude each other."""
    is_pretrained = isinstance(likelihood, PretrainedLikelihood)
    return (ExclusivePretrained if is_pretrained else ExclusiveAppearance)(**vars(likelihood))
