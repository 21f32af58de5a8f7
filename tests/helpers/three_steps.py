"""Squares that move by one of three steps, so that everything about them can be enumerated."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import pytree_dataclass
from jaxpf.likelihoods import EdgeDetector, contours

STEPS = (-6.0, 0.0, 6.0)


@pytree_dataclass
class ThreeSteps:
    """A step left, none, or one right, as likely each."""

    def propagate(self, key, partition, current, previous, parent):
        return current.at[0].add(jax.random.choice(key, jnp.array(STEPS)))


def square(x, y, half=20.0):
    """Control points of a square, pixels."""
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    return half * corners + np.array([x, y])


def opaque(space, num_targets, num_lines):
    """The likelihood of opaque squares."""
    return contours(
        space,
        num_targets,
        exclusion="opaque",
        clutter=0.5,
        detector=EdgeDetector(length=21),
        sigma=3.0,
        num_lines=num_lines,
        independence=0.15,
    )
