"""Boxes that exclude one another: what one has taken does not count for another.

Look-alikes attract one another's boxes, because a likelihood that factors lets the same pixels
speak for all of them.  Here, of every two objects either is in front, with probability one half,
and what its box covers of the other's shows the one in front and not the other: there the other
explains no more than the background does.  With l the log-likelihood of an object alone, relative
to background, and c_ij the share of box j that box i takes::

    log p(y | x) = sum_i l_i + sum_(i<j) log((exp(-c_ij l_j) + exp(-c_ji l_i)) / 2)

A box is larger than its object, and who is half hidden still shows the other half: box i takes
nothing of box j while it covers less than seven tenths of it, all from 95 % on, and in between in
proportion.  Boxes beside one another are judged as without exclusion.  Of two boxes in one place
only the one that looks more like its object counts, so that who is hidden costs nothing, and who
sits on a look-alike's image wins nothing.  For two objects this is a mixture of two normalised
densities wherever ``exp(l)`` is a ratio of densities; for more it is the product over pairs.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood
from jaxpf.shapes.rectangles import area, intersection_area

#: Shares of a box that another one covers: up to the first it takes nothing, from the second all.
_TAKEN = 0.7, 0.95


@pytree_dataclass
class ExclusiveAppearance(DiscriminativeLikelihood):
    """Learned appearance of objects that exclude one another; make one with :func:`excluding`.

    Each object's own log-likelihood is the weighting function of partitioned sampling; with
    ``look_ahead`` each is judged together with where the others are expected.
    """

    def log_joint(self, observation, substates, log_probs):
        """Log-likelihood ``[]`` of all objects' substates ``[P, D]`` together."""
        return self.log_joint_all(observation, substates[..., None], log_probs[..., None])[0]

    def log_joint_all(self, observation, substates, log_probs):
        """The same for N particles, ``[N]``: ``substates [P, D, N]``, ``log_probs [P, N]``."""
        boxes = self._frame_boxes(substates)
        shared = intersection_area(boxes[:, None], boxes[None])
        covered = shared / jnp.maximum(area(boxes), 1e-6)[None]  # [i, j, N]: of j, by i
        least, most = _TAKEN
        taken = jnp.clip((covered - least) / (most - least), 0, 1)
        # A box that cannot be has no share in this; the kernel takes care of its zero.
        own = jnp.where(jnp.isneginf(log_probs), 0.0, log_probs)
        lost = taken * own[None]
        either = jnp.logaddexp(-lost, -jnp.swapaxes(lost, 0, 1)) - np.log(2.0)
        is_pair = np.triu(np.ones(shared.shape[:2], bool), 1)
        pairs = jnp.sum(jnp.where(is_pair[..., None], either, 0.0), axis=(0, 1))
        return jnp.sum(log_probs, axis=0) + pairs

    def _frame_boxes(self, substates):
        """Boxes ``[P, N, 4]`` in the frame, pixels, of substates ``[P, D, N]``."""
        centre, scale = substates[:, :2], substates[:, 2:3]
        extent = scale * jnp.asarray(self.sizes, substates.dtype)[..., None]
        return jnp.moveaxis(jnp.concatenate([centre - extent / 2, extent], axis=1), 1, -1)


def excluding(likelihood: DiscriminativeLikelihood) -> ExclusiveAppearance:
    """The same learned appearance, of objects that exclude one another."""
    fields = dataclasses.fields(likelihood)
    return ExclusiveAppearance(**{one.name: getattr(likelihood, one.name) for one in fields})
