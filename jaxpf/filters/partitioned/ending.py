"""The end of a frame: particles put together, corrected, normalised and reported."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_LOST,
    ParticleState,
    Summary,
    count_unique,
    sanitised,
    summarise,
)
from jaxpf.filters.partitioned import look_ahead
from jaxpf.filters.partitioned.carry import Carry
from jaxpf.lowering.branches import choose, computed_before
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.resampling import weighted
from jaxpf.resampling.components import Components


def finish(
    tracker: Any, label_key: jax.Array, observation: Any, components: Components, carry: Carry
) -> tuple[ParticleState, Summary]:
    """Gather the particles, correct by the joint likelihood, normalise, and report.

    Labels move in between: given the new substates, and before the joint likelihood sees them
    (maccormick1999, section 4).
    """
    ordering, one_partition = tracker.ordering, tracker.num_partitions == 1
    # By partition, not by stage; a particle's draws lie in rows of its own component.
    row = choose(
        ordering.is_split,
        lambda: ordering.rank[components.index].T,
        lambda: jnp.broadcast_to(ordering.rank[0][:, None], carry.lineage.shape),
        is_never_true=one_partition,
    )
    lineage, lagged = _gathered(tracker, carry, row)
    drawn = row * tracker.num_particles + lineage  # where each particle's draws lie
    path_scores = path_score = None
    if carry.path_scores is not None:
        path_scores = carry.path_scores.reshape(-1)[drawn]
        path_score = jnp.sum(path_scores, axis=0)
    label = None
    if tracker.initial_label is not None:
        label = contract.propagate_label_all(tracker.dynamics, label_key, carry.label, lagged[0])
    # Looking ahead, the last stage has weighed everything, unless a label moved since.
    is_weighed = tracker.look_ahead and label is None
    if contract.has_log_joint(tracker.likelihood) and not is_weighed:
        weighting = carry.log_probs.reshape(-1)[drawn]
        carry, correction = _corrected(
            tracker, observation, components, carry, lagged[0], weighting, label
        )
        if path_score is not None:
            path_score = with_gradient_of(path_score, correction)

    every_component = ordering.rank.T, jnp.arange(ordering.rank.shape[0])
    lost = ~jnp.any(carry.seen[every_component], axis=1)

    all_impossible = jnp.all(carry.impossible)
    log_weights = jnp.where(carry.impossible & ~all_impossible, -jnp.inf, carry.log_weights)
    if path_score is not None:
        log_weights = with_gradient_of(log_weights, path_score)
    log_total = jax.nn.logsumexp(log_weights)
    log_weights = choose(
        ordering.literal,
        lambda: weighted.renormalised(log_weights, components),
        lambda: log_weights - log_total,
        is_never_true=one_partition,
    )
    log_weights = computed_before(log_weights)
    if path_scores is not None:
        # What the weights were divided by, or a joint likelihood adds, belongs to no partition.
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
    )
    log_evidence = jnp.where(all_impossible, -jnp.inf, log_total)
    status = (
        STATUS_INVALID_LIKELIHOOD * (carry.num_invalid > 0)
        + STATUS_IMPOSSIBLE * all_impossible
        + STATUS_LOST * jnp.any(lost)
    ).astype(jnp.int32)
    # Whoever was neither resampled nor traded inside the frame is a draw of its own.
    num_unique = choose(
        jnp.any(ordering.resample_after | ordering.exchange_after),
        lambda: count_unique(lineage),
        lambda: jnp.full(lineage.shape[:1], lineage.shape[1], jnp.int32),
        is_never_true=one_partition,
    )
    summary = summarise(state, log_evidence, status, lost, carry.num_invalid, num_unique)
    if label is None:
        return state, summary
    is_label = label == jnp.arange(jnp.shape(tracker.initial_label)[0])[:, None]
    probabilities = is_label.astype(log_weights.dtype) @ jnp.exp(log_weights)
    return state, dataclasses.replace(summary, label_probabilities=probabilities)


def _gathered(tracker: Any, carry: Carry, row: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Lineage ``[P, N]`` and substates ``[2, D, P, N]`` by partition."""
    ordering, num_particles = tracker.ordering, tracker.num_particles

    def gathered():
        lineage = jnp.take_along_axis(carry.lineage, row, axis=0)
        flat = carry.stages.reshape(-1, tracker.num_partitions * num_particles)
        lagged = flat[:, row * num_particles + lineage]
        return lineage, lagged.reshape(carry.stages.shape)

    def their_own():
        if tracker.num_partitions == 1:
            return carry.lineage, carry.stages
        return carry.lineage, carry.stages[:, :, ordering.rank[0]]

    # Without resampling or exchange inside the frame every particle kept its own draws.
    return choose(
        jnp.any(ordering.resample_after | ordering.exchange_after),
        gathered,
        their_own,
        is_never_true=tracker.num_partitions == 1,
    )


def _corrected(
    tracker: Any,
    observation: Any,
    components: Components,
    carry: Carry,
    substates: jax.Array,
    weighting: jax.Array,
    label: jax.Array | None,
) -> tuple[Carry, jax.Array]:
    """Weights by the joint likelihood in place of the stages' weighting functions ``[P, N]``.

    Also the log of the quotient, ``[N]``.
    """
    log_probs = weighting
    if tracker.look_ahead:  # whose stages do not weigh by these
        log_probs = look_ahead.of_single_partitions(tracker, observation, substates)
    log_joint = contract.log_joint_all(tracker.likelihood, observation, substates, log_probs, label)
    log_joint, num_invalid = sanitised(log_joint.astype(weighting.dtype))
    carry = carry._replace(num_invalid=carry.num_invalid + num_invalid)
    correction = log_joint - jnp.sum(jnp.where(jnp.isneginf(weighting), 0.0, weighting), axis=0)
    return carry.absorb(correction, components), correction
