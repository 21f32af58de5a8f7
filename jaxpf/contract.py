"""What a user writes: how a substate moves, and how well it explains a frame.

Both are written for one particle, in about ten lines, as registered pytrees
(``jaxpf.pytree.pytree_dataclass`` makes one of a class).  The kernel vectorises them.
"""

from typing import Any, Protocol

import jax


class Dynamics(Protocol):
    """How a substate moves; written for one particle, registered as a pytree.

    A dynamics may also offer ``propagate_all(key, partition [N], current [D, N],
    previous [D, N], parent [D, N]) -> [D, N]``, which draws for all particles at once.
    """

    def propagate(
        self,
        key: jax.Array,
        partition: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
    ) -> jax.Array:
        """The new substate ``[D]``; ``parent`` ``[D]`` is already moved, zeros for a root."""


class Likelihood(Protocol):
    """How well a substate explains a frame; written for one particle.

    A likelihood may also offer ``log_prob_all(observation, partition [N], substates
    [D, N]) -> [N]`` and, where it does not factor over partitions, ``log_joint(observation,
    substates [P, D], log_probs [P]) -> []``.
    """

    def observe(self, frame: Any) -> Any:
        """What the likelihood needs of a frame, computed once for all runs and particles."""

    def log_prob(self, observation: Any, partition: jax.Array, substate: jax.Array) -> jax.Array:
        """Log-likelihood ``[]`` of one partition's substate ``[D]``."""
