"""Who is in front: a label that moves only while the shapes of two targets are apart.

maccormick1999, section 4: "if x^A and x^B overlap then the occlusion relationship cannot change";
otherwise the label flips with a small probability.
"""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.pytree import pytree_dataclass

#: Probability per frame that the label flips while the shapes are apart, delta of the paper.
FLIP = 0.01


@pytree_dataclass
class WithOcclusion(contract.Dynamics):
    """Dynamics of two opaque targets, and of the label that says which is nearer the camera.

    Attributes:
        dynamics: how the substates move, see ``jaxpf.contract``.
        shapes: has ``overlap(substates [2, D]) -> [] bool``, such as ``OpaqueContours``.
        flip: probability that the label flips in a frame in which the shapes are apart.
    """

    dynamics: Any
    shapes: Any
    flip: Any = FLIP

    @property
    def coupled(self):
        """As ``dynamics`` are."""
        return contract.is_coupled(self.dynamics)

    def propagate_all(self, key, partition, current, previous, parent, *others):
        """The new substates ``[D, N]``."""
        return contract.propagate_all(
            self.dynamics, key, partition, current, previous, parent, *others
        )

    @property
    def at_frame(self):
        """The dynamics that lead to a frame; absent where they are ever the same."""
        at_frame = self.dynamics.at_frame
        return lambda time: dataclasses.replace(self, dynamics=at_frame(time))

    @property
    def predict_all(self):
        """Where the targets are expected; absent where ``dynamics`` does not say."""
        if not contract.has_prediction(self.dynamics):
            raise AttributeError(f"{type(self.dynamics).__name__} predicts nothing")
        return partial(contract.predict_all, self.dynamics)

    @property
    def log_density_all(self):
        """Log-densities of the targets' moves; absent where ``dynamics`` does not say."""
        if not contract.has_log_density(self.dynamics):
            raise AttributeError(f"{type(self.dynamics).__name__} has no density")
        return partial(contract.log_density_all, self.dynamics)

    def propagate_label(self, key, label, substates):
        """The new label ``[]``, 0 or 1, given both targets' new substates ``[2, D]``."""
        flips = ~self.shapes.overlap(substates) & (jax.random.uniform(key) < self.flip)
        return jnp.where(flips, 1 - label, label)

    def log_label(self, new, label, substates):
        """Log-probability ``[]`` of the move from ``label`` to ``new``."""
        stays = jnp.where(new == label, 0.0, -jnp.inf)
        apart = jnp.where(new == label, jnp.log1p(-self.flip), jnp.log(self.flip))
        return jnp.where(self.shapes.overlap(substates), stays, apart)
