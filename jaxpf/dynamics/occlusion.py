"""Who is in front: a label that says in which order opaque targets lie in depth, and how it moves.

maccormick1999, section 4, of two targets: "if x^A and x^B overlap then the occlusion relationship
cannot change"; otherwise the label flips with a small probability.

**More than two.**  With that probability one of the P - 1 pairs that are neighbours in depth, any
as likely as another, changes places, unless the two overlap.  Two targets change their order only
as neighbours, so that overlapping ones never do, and two targets are the paper's case.

Given the shapes, the move from one order to another is as likely as the move back, since both are
the exchange of one pair at one place.  So the uniform law on all orders is kept, and it is
reversible.  From a given order exactly those can be reached in which every overlapping pair is as
it was: while another of these has not been reached, there are neighbours whom it has the other way
round, and they do not overlap.  Among these orders, too, all become equally likely.
"""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.shapes.depth import depth_orders, neighbours_exchanged

#: Probability per frame that the label flips while the shapes are apart, delta of the paper.
FLIP = 0.01


@pytree_dataclass
class WithOcclusion(contract.Dynamics):
    """Dynamics of two to four opaque targets, and of the label that says who is nearer the camera.

    Labels are those of ``jaxpf.shapes.depth``; of two targets 0 says that the first is nearer.

    Attributes:
        dynamics: how the substates move, see ``jaxpf.contract``.
        shapes: such as ``OpaqueContours``; has ``overlap(substates [2, D]) -> [] bool`` of two
            targets, or of more ``overlap(substates [P, D], one [], other []) -> [] bool``.
        flip: probability that in a frame two neighbours in depth, drawn at random, change places
            if they do not overlap.
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
        """The new label ``[]`` given all targets' new substates ``[P, D]``."""
        count = substates.shape[0]
        uniform = jax.random.uniform(key)
        # Below ``flip`` the number is uniform once more, and says where in the order.
        share = uniform / jnp.where(self.flip > 0, self.flip, 1.0)
        place = jnp.clip((share * (count - 1)).astype(int), 0, count - 2)
        flips = ~self._overlap(label, place, substates) & (uniform < self.flip)
        return jnp.where(flips, jnp.asarray(neighbours_exchanged(count))[label, place], label)

    def log_label(self, new, label, substates):
        """Log-probability ``[]`` of the move from ``label`` to ``new``."""
        count = substates.shape[0]
        over = [self._overlap(label, place, substates) for place in range(count - 1)]
        share = jnp.where(jnp.stack(over), 0.0, 1.0 / (count - 1))
        is_new = jnp.asarray(neighbours_exchanged(count))[label] == new
        moves = self.flip * jnp.sum(jnp.where(is_new, share, 0.0))
        log_moves = jnp.log(jnp.where(moves > 0, moves, 1.0))  # its derivative stays finite
        log_moves = jnp.where(moves > 0, log_moves, -jnp.inf)
        return jnp.where(new == label, jnp.log1p(-self.flip * jnp.sum(share)), log_moves)

    def _overlap(self, label, place, substates):
        """Whether the targets at a place of the order and at the next one overlap, bool ``[]``."""
        count = substates.shape[0]
        if count == 2:
            return self.shapes.overlap(substates)
        order = jnp.asarray(depth_orders(count))[label]
        return self.shapes.overlap(substates, order[place], order[place + 1])
