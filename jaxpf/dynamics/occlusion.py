"""Depth order of opaque targets: a discrete label and its transition probabilities.

maccormick1999, section 4, of two targets: "if x^A and x^B overlap then the occlusion relationship
cannot change"; otherwise the label flips with a small probability.

**More than two.**  With that probability, one of the P - 1 pairs of neighbours in depth is drawn
uniformly and exchanged, unless the two overlap.  Targets change their order only as neighbours, so
the order of overlapping targets never changes.  For two targets this is the paper's rule.

Given the shapes, a move between two orders is as likely as its reverse, since both exchange one
pair at the same place.  The chain is therefore reversible, and the uniform distribution over all
orders is stationary.  From a given order exactly those orders can be reached that agree on every
overlapping pair: as long as the current order differs from such an order, it has a pair of
neighbours that the other order reverses, and that pair does not overlap.  Among these orders the
label converges to the uniform distribution.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.wrapped import offered
from jaxpf.shapes.depth import depth_orders, neighbours_exchanged

#: Probability per frame that the label flips while the shapes do not overlap, delta of the paper.
FLIP = 0.01


@pytree_dataclass
class WithOcclusion(contract.Dynamics):
    """Dynamics of two to four opaque targets and of their depth-order label.

    Labels are those of ``jaxpf.shapes.depth``; for two targets, 0 means that the first is nearer.

    Attributes:
        dynamics: of the substates, see ``jaxpf.contract``.
        shapes: such as ``OpaqueContours``; has ``overlap(substates [2, D]) -> [] bool`` for two
            targets, or ``overlap(substates [P, D], one [], other []) -> [] bool`` for more.
        flip: probability per frame that a random pair of neighbours in depth is exchanged if it
            does not overlap.
    """

    dynamics: Any
    shapes: Any
    flip: Any = FLIP

    def __post_init__(self):
        check_number("flip", self.flip, least=0, most=1)

    def __getattr__(self, name):
        """What ``dynamics`` offers beyond moves and labels."""
        return offered(self, "dynamics", name)

    def propagate_all(self, key, partition, current, previous, parent, *others):
        """The new substates ``[D, N]``."""
        return contract.propagate_all(
            self.dynamics, key, partition, current, previous, parent, *others
        )

    def propagate_label(self, key, label, substates):
        """The new label ``[]``, given all targets' new substates ``[P, D]``."""
        count = substates.shape[0]
        uniform = jax.random.uniform(key)
        # Given ``uniform < flip``, uniform / flip is uniform again, and selects the pair.
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
        """Whether the targets at ``place`` and ``place + 1`` of the order overlap, bool ``[]``."""
        count = substates.shape[0]
        if count == 2:
            return self.shapes.overlap(substates)
        order = jnp.asarray(depth_orders(count))[label]
        return self.shapes.overlap(substates, order[place], order[place + 1])
