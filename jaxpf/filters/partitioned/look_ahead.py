"""Look-ahead weighting: each partition weighed together with where the others are expected.

Partitioned sampling weighs partition A by a function of A alone, although a joint likelihood
knows more: with two look-alikes that exclude one another, a particle whose A sits on B's image is
bound to lose, and is found out one stage too late.  Here stage j weighs by ``L_j / L_{j-1}``, where
``L_j`` is the joint likelihood of what the first stages drew and of the noise-free predictions of
the rest; the idea is that of the coordinate particle filter (Wuethrich et al. 2015), the weights
are these.  Their product telescopes to the joint likelihood of what was drawn, so every weight is
exact, and the evidence is unbiased wherever ``L_j > 0`` for all that has ``L_P > 0``.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.filters.partitioned.carry import Carry


def log_factor(shared: Any, stage: jax.Array, carry: Carry, drawn: Any) -> jax.Array:
    """Log of what a stage multiplies the weights by, ``L_j / L_{j-1}``, ``[N]``."""
    tracker = shared.tracker
    partitions = jnp.arange(tracker.num_partitions)
    one = jax.vmap(lambda p: _substates(shared, stage, carry, drawn, p), out_axes=1)
    substates = one(partitions)  # [D, P, N]
    log_probs = of_single_partitions(tracker, shared.observation, substates)
    label = None if tracker.initial_label is None else carry.label
    joint = contract.log_joint_all(
        tracker.likelihood, shared.observation, substates, log_probs, label
    )
    return joint.astype(carry.log_probs.dtype) - _so_far(stage, carry)


def of_single_partitions(tracker: Any, observation: Any, substates: jax.Array) -> jax.Array:
    """Log-likelihoods ``[P, N]`` of substates ``[D, P, N]``, each by itself, for ``log_joint``.

    XLA leaves them out where that does not ask for them.
    """

    def one(partition, substates):
        everyone = jnp.full(substates.shape[-1], partition)
        return contract.log_prob_all(tracker.likelihood, observation, everyone, substates)

    return jax.vmap(one, in_axes=(0, 1))(jnp.arange(substates.shape[1]), substates)


def _so_far(stage: jax.Array, carry: Carry) -> jax.Array:
    """Log ``L_{j-1}``, ``[N]``: the factors of a particle's own stages, which telescope to it.

    A factor of zero was left out of the weights, or the particle has none.
    """
    factors = jnp.take_along_axis(carry.log_probs, carry.lineage, axis=1)
    is_past = jnp.arange(factors.shape[0])[:, None] < stage
    return jnp.sum(jnp.where(is_past & ~jnp.isneginf(factors), factors, 0.0), axis=0)


def _substates(
    shared: Any, stage: jax.Array, carry: Carry, drawn: Any, partition: jax.Array
) -> jax.Array:
    """One partition in every particle, ``[D, N]``: as drawn, or as predicted."""
    tracker, lagged = shared.tracker, shared.state.lagged
    dimension, num_particles = lagged.shape[1], tracker.num_particles
    row = tracker.ordering.rank[shared.components.index, partition]
    # Before its stage a row holds the particle of the frame before, and after it the slot drawn.
    slot = jnp.take_along_axis(carry.lineage, row[None], axis=0)[0]
    past = lagged.reshape(2, dimension, -1)[:, :, partition * num_particles + slot]
    expected = contract.predict_all(
        tracker.dynamics, jnp.full((num_particles,), partition), past[0], past[1]
    )
    known = carry.stages[0].reshape(dimension, -1)[:, row * num_particles + slot]
    later = jnp.where(row == stage, drawn.substates, expected.astype(known.dtype))
    return jnp.where(row < stage, known, later)
