"""A stage's weight factors: by each partition's likelihood, or by the joint likelihood.

Without joint weighting each stage weights by ``log_prob`` of its partition, and a joint likelihood
corrects the product at the frame's end.

With it, partitions are weighted jointly with the predicted substates of later ones.  Consider two
look-alikes A and B that exclude one another.  A particle whose A sits on B's image has low joint
likelihood, but ``log_prob`` of A alone reveals this one stage too late.  Here stage j weights by
``L_j / L_{j-1}``, where ``L_j`` is the joint likelihood of the draws of the first j stages and of
the noise-free predictions of the others (the idea of the coordinate particle filter, Wuethrich et
al. 2015).  The product telescopes to the joint likelihood, so the evidence is unbiased if
``L_j > 0`` wherever ``L_P > 0``.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.filters.partitioned.carry import Carry, Drawn, Settings, Shared


def log_factor(shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn) -> jax.Array:
    """Log of a stage's weight factors, ``[N]``."""
    tracker, observation = shared.tracker, shared.observation
    if not tracker.joint_weighting:
        return contract.log_prob_all(
            tracker.likelihood, observation, drawn.partition, drawn.substates
        )
    of_one = jax.vmap(lambda p: _expected(shared, stage, carry, drawn, p), out_axes=1)
    substates = of_one(jnp.arange(tracker.num_partitions))  # [D, P, N]
    label = None if tracker.initial_label is None else carry.label
    joint = log_joint(tracker, observation, substates, label)
    return joint.astype(carry.log_probs.dtype) - _log_joint_before(stage, carry)


def is_complete(tracker: Settings) -> bool:
    """Whether the product of the stages' factors is the full likelihood.

    With joint weighting it is unless a label moves after the last stage.
    """
    if tracker.joint_weighting:
        return tracker.initial_label is None
    return not calls.has_log_joint(tracker.likelihood)


def log_joint(
    tracker: Settings,
    observation: Any,
    substates: jax.Array,
    label: jax.Array | None,
    log_probs: jax.Array | None = None,
) -> jax.Array:
    """Joint log-likelihoods ``[N]`` of substates ``[D, P, N]``.

    Those of single partitions, ``log_probs`` ``[P, N]``, are computed unless they are known; XLA
    drops them if unused.
    """

    def of_one(partition, substates):
        everywhere = jnp.full(substates.shape[-1], partition)
        return contract.log_prob_all(tracker.likelihood, observation, everywhere, substates)

    if log_probs is None:
        partitions = jnp.arange(substates.shape[1])
        log_probs = jax.vmap(of_one, in_axes=(0, 1))(partitions, substates)
    return calls.log_joint_all(tracker.likelihood, observation, substates, log_probs, label)


def _log_joint_before(stage: jax.Array, carry: Carry) -> jax.Array:
    """Log ``L_{j-1}``, ``[N]``: the sum of the log factors of a particle's earlier stages.

    Zero factors are omitted: either the weights skipped them, or the particle has no weight.
    """
    factors = jnp.take_along_axis(carry.log_probs, carry.lineage, axis=1)
    is_past = jnp.arange(factors.shape[0])[:, None] < stage
    return jnp.sum(jnp.where(is_past & ~jnp.isneginf(factors), factors, 0.0), axis=0)


def _expected(
    shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn, partition: jax.Array
) -> jax.Array:
    """One partition's substates in all particles, ``[D, N]``: drawn or predicted."""
    tracker, lagged = shared.tracker, shared.state.lagged
    dimension, num_particles = lagged.shape[1], tracker.num_particles
    row = tracker.ordering.rank[shared.components.index, partition]
    # Before its stage a row holds a particle of the previous frame, afterwards the drawing slot.
    slot = jnp.take_along_axis(carry.lineage, row[None], axis=0)[0]
    past = lagged.reshape(2, dimension, -1)[:, :, partition * num_particles + slot]
    predicted = calls.predict_all(
        tracker.dynamics, jnp.full((num_particles,), partition), past[0], past[1]
    )
    earlier = carry.stages[0].reshape(dimension, -1)[:, row * num_particles + slot]
    later = jnp.where(row == stage, drawn.substates, predicted.astype(earlier.dtype))
    return jnp.where(row < stage, earlier, later)
