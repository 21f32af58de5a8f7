"""Strategies for a stage's weight factors.

``weighing_of`` chooses one from a tracker's settings.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.errors import check_separate
from jaxpf.filters.partitioned.carry import Carry, Drawn, Shared
from jaxpf.filters.partitioned.settings import Settings


class Weighing:
    """Weights each partition by ``log_prob``; a joint likelihood corrects at the frame's end."""

    def check(self, tracker: Settings) -> None:
        """Refuse a tracker that is incompatible with the strategy."""

    def log_factor(self, shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn) -> jax.Array:
        """Log of a stage's weight factors, ``[N]``."""
        return contract.log_prob_all(
            shared.tracker.likelihood, shared.observation, drawn.partition, drawn.substates
        )

    def is_complete(self, tracker: Settings) -> bool:
        """Whether the product of the stages' factors is the full likelihood."""
        return not calls.has_log_joint(tracker.likelihood)

    def log_probs(
        self, tracker: Settings, observation: Any, substates: jax.Array, factors: jax.Array
    ) -> jax.Array:
        """Log-likelihoods ``[P, N]`` of single partitions, given the stages' ``factors``."""
        return factors


class JointWeighting(Weighing):
    """Weights each partition jointly with the predicted substates of later partitions.

    Consider two look-alikes A and B that exclude one another.  A particle whose A sits on B's image
    has low joint likelihood, but ``log_prob`` of A alone reveals this one stage too late.  Here
    stage j weights by ``L_j / L_{j-1}``, where ``L_j`` is the joint likelihood of the draws of the
    first j stages and of the noise-free predictions of the others (the idea of the coordinate
    particle filter, Wuethrich et al. 2015).  The product telescopes to the joint likelihood, so the
    evidence is unbiased if ``L_j > 0`` wherever ``L_P > 0``.
    """

    def check(self, tracker: Settings) -> None:
        """See ``Weighing``."""
        check_separate(
            "joint_weighting",
            (any(parent >= 0 for parent in tracker.parents), "a part tree"),
            (tracker.motion_gradient != "pathwise", f"motion_gradient={tracker.motion_gradient!r}"),
        )

    def log_factor(self, shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn) -> jax.Array:
        """See ``Weighing``: ``log L_j - log L_{j-1}``."""
        tracker = shared.tracker
        partitions = jnp.arange(tracker.num_partitions)
        of_one = jax.vmap(lambda p: _expected(shared, stage, carry, drawn, p), out_axes=1)
        substates = of_one(partitions)  # [D, P, N]
        log_probs = _of_single_partitions(tracker, shared.observation, substates)
        label = None if tracker.initial_label is None else carry.label
        joint = calls.log_joint_all(
            tracker.likelihood, shared.observation, substates, log_probs, label
        )
        return joint.astype(carry.log_probs.dtype) - _log_joint_before(stage, carry)

    def is_complete(self, tracker: Settings) -> bool:
        """See ``Weighing``: true unless a label moves after the last stage."""
        return tracker.initial_label is None

    def log_probs(
        self, tracker: Settings, observation: Any, substates: jax.Array, factors: jax.Array
    ) -> jax.Array:
        """See ``Weighing``: recomputed, because the stages use other factors."""
        return _of_single_partitions(tracker, observation, substates)


def weighing_of(tracker: Settings) -> Weighing:
    """Choose the strategy for a tracker's settings."""
    return JointWeighting() if tracker.joint_weighting else Weighing()


def _of_single_partitions(tracker: Settings, observation: Any, substates: jax.Array) -> jax.Array:
    """Log-likelihoods ``[P, N]`` of substates ``[D, P, N]``; XLA drops them if unused."""

    def of_one(partition, substates):
        everywhere = jnp.full(substates.shape[-1], partition)
        return contract.log_prob_all(tracker.likelihood, observation, everywhere, substates)

    return jax.vmap(of_one, in_axes=(0, 1))(jnp.arange(substates.shape[1]), substates)


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
