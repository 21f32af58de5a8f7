"""The end of a frame: reassemble, correct, normalise and report the particles."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.logs import counted, finite, normalised
from jaxpf.contract.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_WITHOUT_LIKELIHOOD,
    ParticleState,
    Summary,
    count_unique,
    sanitised,
    summarise,
)
from jaxpf.filters.partitioned import labels
from jaxpf.filters.partitioned.carry import Carry, Settings
from jaxpf.filters.partitioned.weighing import is_complete, log_joint
from jaxpf.lowering.branches import choose, computed_before
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.resampling import weighted
from jaxpf.resampling.components import Components


def finish(
    tracker: Settings,
    label_key: jax.Array,
    observation: Any,
    components: Components,
    carry: Carry,
) -> tuple[ParticleState, Summary]:
    """Gather the particles, correct by the joint likelihood, normalise, and report.

    Labels move given the new substates, before the joint likelihood is evaluated
    (maccormick1999, section 4).
    """
    ordering, one_partition = tracker.ordering, tracker.num_partitions == 1
    # By partition, not by stage: the rows depend on the particle's component.
    row = choose(
        ordering.is_split,
        lambda: ordering.rank[components.index].T,
        lambda: jnp.broadcast_to(ordering.rank[0][:, None], carry.lineage.shape),
        is_never_true=one_partition,
        cheap=True,
    )
    lineage, lagged = _gathered(tracker, carry, row)
    drawn = row * tracker.num_particles + lineage  # index of each particle's draws
    path_scores = path_score = None
    if carry.path_scores is not None:
        path_scores = carry.path_scores.reshape(-1)[drawn]
        path_score = jnp.sum(path_scores, axis=0)
    label = label_score = None
    if tracker.initial_label is not None:
        label, label_score = labels.move(tracker, label_key, carry.label, lagged[0])
        carry = labels.weigh(tracker, label, carry, components)
    log_quotient = None
    if not is_complete(tracker):
        factors = carry.log_probs.reshape(-1)[drawn]
        carry, log_quotient = _corrected(
            tracker, observation, components, carry, lagged[0], factors, label
        )
    if path_score is None and label_score is not None:
        carry = carry._replace(log_weights=with_gradient_of(carry.log_weights, label_score))
    for score in (label_score, log_quotient):
        if path_score is not None and score is not None:
            path_score = with_gradient_of(path_score, score)

    every_component = ordering.rank.T, jnp.arange(ordering.rank.shape[0])
    lost = ~jnp.any(carry.seen[every_component], axis=1)

    all_impossible = jnp.all(carry.impossible)
    if path_score is not None:
        carry = carry._replace(log_weights=with_gradient_of(carry.log_weights, path_score))
    log_weights, log_total = _normalised(carry, components, all_impossible)
    log_weights = choose(
        ordering.literal,
        lambda: weighted.renormalised(log_weights, components),
        lambda: log_weights,
        is_never_true=one_partition,
        cheap=True,
    )
    log_weights = computed_before(log_weights)
    if path_scores is not None:
        # Divisors of the weights, or a joint likelihood's correction, belong to no partition.
        rest = log_weights - jnp.sum(path_scores, axis=0)
        path_scores = with_gradient_of(path_scores, rest[None] / tracker.num_partitions)
    state = ParticleState(
        lagged=lagged,
        log_weights=log_weights,
        lineage=lineage,
        component=carry.label if label is None else components.index,
        weighted=jnp.ones((), bool),
        path_scores=path_scores,
        label=label,
        sources=None if carry.sources is None else carry.sources.reshape(-1)[drawn],
        selections=carry.selections,
    )
    log_evidence = jnp.where(all_impossible, -jnp.inf, log_total)
    status = (
        STATUS_INVALID_LIKELIHOOD * (carry.num_invalid > 0)
        + STATUS_IMPOSSIBLE * all_impossible
        + STATUS_WITHOUT_LIKELIHOOD * jnp.any(lost)
    ).astype(jnp.int32)
    # Without resampling or exchange inside the frame, all draws are distinct.
    num_unique = choose(
        jnp.any(ordering.resample_after | ordering.exchange_after),
        lambda: count_unique(lineage),
        lambda: jnp.full(lineage.shape[:1], lineage.shape[1], jnp.int32),
        is_never_true=one_partition,
        cheap=True,
    )
    summary = summarise(state, log_evidence, status, lost, carry.num_invalid, num_unique)
    if label is None:
        return state, summary
    probabilities = labels.probabilities(tracker, label, log_weights)
    return state, dataclasses.replace(summary, label_probabilities=probabilities)


def _gathered(tracker: Settings, carry: Carry, row: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Lineage ``[P, N]`` and substates ``[2, D, P, N]`` by partition."""
    ordering, num_particles = tracker.ordering, tracker.num_particles

    def gathered():
        lineage = jnp.take_along_axis(carry.lineage, row, axis=0)
        flat = carry.stages.reshape(-1, tracker.num_partitions * num_particles)
        lagged = flat[:, row * num_particles + lineage]
        return lineage, lagged.reshape(carry.stages.shape)

    def own_draws():
        if tracker.num_partitions == 1:
            return carry.lineage, carry.stages
        return carry.lineage, carry.stages[:, :, ordering.rank[0]]

    # Without resampling or exchange inside the frame, every particle keeps its own draws.
    return choose(
        jnp.any(ordering.resample_after | ordering.exchange_after),
        gathered,
        own_draws,
        is_never_true=tracker.num_partitions == 1,
        cheap=True,
    )


def _corrected(
    tracker: Settings,
    observation: Any,
    components: Components,
    carry: Carry,
    substates: jax.Array,
    factors: jax.Array,
    label: jax.Array | None,
) -> tuple[Carry, jax.Array]:
    """Replace the stages' ``factors`` ``[P, N]`` in the weights by the joint likelihood.

    Also returns the log of the quotient, ``[N]``.
    """
    # With joint weighting, the stages have other factors than the likelihoods of partitions.
    log_probs = None if tracker.joint_weighting else factors
    joint = log_joint(tracker, observation, substates, label, log_probs)
    joint, num_invalid = sanitised(joint.astype(factors.dtype))
    carry = carry._replace(num_invalid=carry.num_invalid + num_invalid)
    joint, log_scale = carry.relative(joint, components)
    largest = finite(lax.stop_gradient(jnp.max(factors, axis=1)))
    log_quotient = joint - jnp.sum(finite(factors - largest[:, None]), axis=0)
    carry = carry.multiplied(log_quotient, log_scale - jnp.sum(largest), components)
    return carry, log_quotient


def _normalised(
    carry: Carry, components: Components, all_impossible: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Log-weights ``[N]``, normalised over all components, and the log of their total, ``[]``.

    Impossible components get no weight, unless all are impossible.
    """
    log_scale = carry.log_scale
    if log_scale.shape[1] == 1:
        # Nothing has changed the weights since the last stage found the largest.
        known = carry.largest[0] if carry.lineage.shape[0] == 1 else None
        log_weights, log_total = normalised(carry.log_weights, largest=known)
        return log_weights, log_scale[0, 0] + (log_scale[1, 0] + log_total)
    ignored = components.spread(carry.impossible & ~all_impossible)
    log_weights = jnp.where(ignored, -jnp.inf, carry.log_weights)
    first = jnp.argmax(counted(components.spread(log_scale[0]), log_weights))
    first = components.index[first]
    apart = jnp.sum(log_scale - log_scale[:, first, None], axis=0)
    log_weights, log_total = normalised(log_weights + components.spread(apart))
    return log_weights, log_scale[0, first] + (log_scale[1, first] + log_total)
