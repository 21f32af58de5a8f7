"""What a stage multiplies the weights by: strategies that the kernel asks at every stage.

``weighing_of`` picks one from a tracker's settings.
"""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.filters.partitioned.carry import Carry, Drawn, Shared

if TYPE_CHECKING:
    from jaxpf.filters.partitioned.tracker import Partitioned


class Weighing:
    """Weighs each partition alone, by ``log_prob``; a joint likelihood corrects at the end."""

    def check(self, tracker: "Partitioned") -> None:
        """Refuse a tracker that the strategy does not work with."""

    def log_factor(self, shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn) -> jax.Array:
        """Log of what a stage multiplies the weights by, ``[N]``."""
        return contract.log_prob_all(
            shared.tracker.likelihood, shared.observation, drawn.partition, drawn.substates
        )

    def is_complete(self, tracker: "Partitioned") -> bool:
        """Whether the stages' factors already multiply to the whole likelihood."""
        return not contract.has_log_joint(tracker.likelihood)

    def log_probs(
        self, tracker: "Partitioned", observation: Any, substates: jax.Array, factors: jax.Array
    ) -> jax.Array:
        """Log-likelihoods ``[P, N]`` of single partitions, given the stages' ``factors``."""
        return factors


class LookAhead(Weighing):
    """Weighs each partition together with where the others are expected.

    With two look-alikes that exclude one another, a particle whose A sits on B's image is bound to
    lose, and ``log_prob`` of A alone notices one stage too late.  Here stage j weighs by
    ``L_j / L_{j-1}``, where ``L_j`` is the joint likelihood of what the first stages drew and of
    the noise-free predictions of the rest (the idea of the coordinate particle filter, Wuethrich
    et al. 2015).  The product telescopes to the joint likelihood, so the evidence is unbiased
    wherever ``L_j > 0`` for all that has ``L_P > 0``.
    """

    def check(self, tracker: "Partitioned") -> None:
        """See ``Weighing``."""
        likelihood, dynamics = type(tracker.likelihood).__name__, type(tracker.dynamics).__name__
        if not contract.has_log_joint(tracker.likelihood):
            raise InputError(
                f"look_ahead weighs all objects together, and {likelihood} weighs each by itself "
                "(it has no log_joint); leave look_ahead out."
            )
        if not contract.has_prediction(tracker.dynamics):
            raise InputError(
                f"look_ahead needs the method predict of the dynamics, and {dynamics} has none; "
                "write it (see jaxpf.contract.DynamicsWithPrediction) or leave look_ahead out."
            )
        for used, what in (
            (any(parent >= 0 for parent in tracker.parents), "a part tree"),
            (tracker.motion_gradient != "pathwise", f"motion_gradient={tracker.motion_gradient!r}"),
        ):
            if used:
                raise InputError(f"look_ahead does not work with {what}; leave one of them out.")

    def log_factor(self, shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn) -> jax.Array:
        """See ``Weighing``: ``log L_j - log L_{j-1}``."""
        tracker = shared.tracker
        partitions = jnp.arange(tracker.num_partitions)
        of_one = jax.vmap(lambda p: _expected(shared, stage, carry, drawn, p), out_axes=1)
        substates = of_one(partitions)  # [D, P, N]
        log_probs = _of_single_partitions(tracker, shared.observation, substates)
        label = None if tracker.initial_label is None else carry.label
        joint = contract.log_joint_all(
            tracker.likelihood, shared.observation, substates, log_probs, label
        )
        return joint.astype(carry.log_probs.dtype) - _log_joint_before(stage, carry)

    def is_complete(self, tracker: "Partitioned") -> bool:
        """See ``Weighing``: unless a label moves after the last stage."""
        return tracker.initial_label is None

    def log_probs(
        self, tracker: "Partitioned", observation: Any, substates: jax.Array, factors: jax.Array
    ) -> jax.Array:
        """See ``Weighing``: computed anew, because the stages do not weigh by these."""
        return _of_single_partitions(tracker, observation, substates)


def weighing_of(tracker: "Partitioned") -> Weighing:
    """The strategy that a tracker's settings ask for."""
    return LookAhead() if tracker.look_ahead else Weighing()


def _of_single_partitions(
    tracker: "Partitioned", observation: Any, substates: jax.Array
) -> jax.Array:
    """Log-likelihoods ``[P, N]`` of substates ``[D, P, N]``; XLA drops them where unused."""

    def of_one(partition, substates):
        everywhere = jnp.full(substates.shape[-1], partition)
        return contract.log_prob_all(tracker.likelihood, observation, everywhere, substates)

    return jax.vmap(of_one, in_axes=(0, 1))(jnp.arange(substates.shape[1]), substates)


def _log_joint_before(stage: jax.Array, carry: Carry) -> jax.Array:
    """Log ``L_{j-1}``, ``[N]``: the sum of the log-factors of a particle's earlier stages.

    A factor of zero was left out of the weights, or the particle has no weight.
    """
    factors = jnp.take_along_axis(carry.log_probs, carry.lineage, axis=1)
    is_past = jnp.arange(factors.shape[0])[:, None] < stage
    return jnp.sum(jnp.where(is_past & ~jnp.isneginf(factors), factors, 0.0), axis=0)


def _expected(
    shared: Shared, stage: jax.Array, carry: Carry, drawn: Drawn, partition: jax.Array
) -> jax.Array:
    """One partition in every particle, ``[D, N]``: as drawn, or as predicted."""
    tracker, lagged = shared.tracker, shared.state.lagged
    dimension, num_particles = lagged.shape[1], tracker.num_particles
    row = tracker.ordering.rank[shared.components.index, partition]
    # Before its stage a row holds the particle of the frame before, and after it the slot drawn.
    slot = jnp.take_along_axis(carry.lineage, row[None], axis=0)[0]
    past = lagged.reshape(2, dimension, -1)[:, :, partition * num_particles + slot]
    predicted = contract.predict_all(
        tracker.dynamics, jnp.full((num_particles,), partition), past[0], past[1]
    )
    earlier = carry.stages[0].reshape(dimension, -1)[:, row * num_particles + slot]
    later = jnp.where(row == stage, drawn.substates, predicted.astype(earlier.dtype))
    return jnp.where(row < stage, earlier, later)
