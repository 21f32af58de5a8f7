"""What a user writes: how a substate moves, and how well it explains a frame.

Both are written for one particle, in about ten lines, as registered pytrees
(``jaxpf.pytree.pytree_dataclass`` makes one of a class).  The kernel vectorises them.
"""

from typing import Any, Protocol

import jax


class Dynamics(Protocol):
    """How a substate moves; written for one particle, registered as a pytree.

    A dynamics may also offer ``propagate_all(key, partition [N], current [D, N],
    previous [D, N], parent [D, N]) -> [D, N]``, which draws for all particles at once; and
    ``log_density(partition [], new [D], current [D], previous [D], parent [D]) -> []``, the
    log of the density it draws ``new`` from, for ``motion_gradient="score"`` (see
    ``jaxpf.gradients``), or the same for all particles at once, ``log_density_all``.
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
    substates [P, D], log_probs [P]) -> []``.  The attribute ``state_gradient``, true if absent,
    says whether ``log_prob`` has a derivative in the substate: a likelihood of whole pixels
    has none but zero.
    """

    def observe(self, frame: Any) -> Any:
        """What the likelihood needs of a frame, computed once for all runs and particles."""

    def log_prob(self, observation: Any, partition: jax.Array, substate: jax.Array) -> jax.Array:
        """Log-likelihood ``[]`` of one partition's substate ``[D]``."""


def of_partition(values: jax.Array, partition: jax.Array) -> jax.Array:
    """Each particle's row of ``values`` ``[P, ...]``: ``[N, ...]``, or ``[1, ...]`` if P is 1.

    The derivative of a look-up is a sum over the runs for each particle, and then over the
    particles; with one partition all is one sum, at a fraction of the time.
    """
    return values if values.shape[0] == 1 else values[partition]


def propagate(dynamics, key, partition, current, previous, parent):
    """All particles at once, ``[D, N]``, by the batched method if there is one."""
    if hasattr(dynamics, "propagate_all"):
        return dynamics.propagate_all(key, partition, current, previous, parent)
    keys = jax.random.split(key, partition.shape[0])
    return jax.vmap(dynamics.propagate, in_axes=(0, 0, 1, 1, 1), out_axes=1)(
        keys, partition, current, previous, parent
    )


def log_prob(likelihood, observation, partition, substates):
    """Log-likelihoods ``[N]`` of substates ``[D, N]``, by the batched method if there is one."""
    if hasattr(likelihood, "log_prob_all"):
        return likelihood.log_prob_all(observation, partition, substates)
    return jax.vmap(likelihood.log_prob, in_axes=(None, 0, 1))(observation, partition, substates)


def log_density(dynamics, partition, new, current, previous, parent):
    """Log-densities ``[N]`` of moves to ``new`` ``[D, N]``, by the batched method if any."""
    if hasattr(dynamics, "log_density_all"):
        return dynamics.log_density_all(partition, new, current, previous, parent)
    return jax.vmap(dynamics.log_density, in_axes=(0, 1, 1, 1, 1))(
        partition, new, current, previous, parent
    )
