"""The partitioned kernel: SIR, PS, DPS, SPS and branched sampling in one compiled program.

A frame is P stages of one operation: propagate the partition whose turn it is in the
particle's component, weigh it, exchange parts where the ordering says so, and resample
within components.  Two ideas keep it short and fast:

- *Stage rows.*  Inside a frame, row j of every array belongs to stage j, whatever
  partition a component processes there, so that a stage writes one row in place.
- *Lineage instead of copies.*  Resampling moves no substates.  A particle is P integers:
  ``lineage[j]`` is the slot that drew the partition of row j or, before its stage, the
  particle of the previous frame it continues.  Resampling and exchange permute these
  integers, and the substates are gathered once, at the end of the frame.
"""

from collections.abc import Callable
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.ad_checkpoint import checkpoint_name

from jaxpf import contract
from jaxpf.filters import resampling
from jaxpf.filters.partitioned import exchange, levels, transport
from jaxpf.filters.partitioned.carry import Frame
from jaxpf.filters.partitioned.gradients import barrier, with_gradient_of
from jaxpf.filters.partitioned.ordering import Ordering
from jaxpf.filters.resampling import Components
from jaxpf.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_LOST,
    ParticleState,
    Summary,
    summarise,
)

#: Name by which ``jax.checkpoint`` may keep ancestors: few bytes, and dear to compute again.
ANCESTORS = "ancestors"


def begin(tracker, key, state) -> tuple[Components, Frame]:
    """Resample jointly, then split the particles into the ordering's components."""
    num_particles, ordering = tracker.num_particles, tracker.ordering
    resample_key, split_key = jax.random.split(key)
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    whole = resampling.one_component(num_particles)
    incoming = state.log_weights
    if state.scores is not None:
        incoming = lax.stop_gradient(incoming)  # the scores hold their derivative
    chosen, log_weights, equal = _resample(tracker, resample_key, incoming, incoming, whole)
    # A set that was only drawn has equal weights already: resampling it would lose particles.
    ancestors = jnp.where(state.weighted, chosen, identity)
    uniform = jnp.full_like(log_weights, -np.log(num_particles))
    log_weights = jnp.where(state.weighted & ~equal, log_weights, uniform)
    if ordering.by_label:
        labels = state.component[ancestors]
        shuffle = exchange.order_by_group(labels)
        labels = labels[shuffle]
        ancestors, log_weights = ancestors[shuffle], log_weights[shuffle]
        sizes = jnp.zeros((ordering.order.shape[0],), jnp.int32).at[labels].add(1)
        components = resampling.components_of_sizes(sizes, num_particles)
    else:
        edges = jnp.round(jnp.cumsum(ordering.fractions) * num_particles).astype(jnp.int32)
        components = resampling.components_of_sizes(
            jnp.diff(edges, prepend=jnp.zeros((1,), jnp.int32)), num_particles
        )
        labels = components.index

        def shuffled():
            shuffle = jax.random.permutation(split_key, identity)
            return ancestors[shuffle], log_weights[shuffle]

        # The order of particles matters only where it decides who joins which component.
        ancestors, log_weights = _choose(
            ordering, _is_split(ordering), shuffled, lambda: (ancestors, log_weights)
        )
    shape, exchanging = (tracker.num_partitions, num_particles), levels.may_exchange(tracker)
    stages, lineage = jnp.zeros_like(state.lagged), jnp.broadcast_to(ancestors, shape)
    if tracker.gradient == "transport":
        # Blending moves substates: rows hold the past until their stage has come.
        stages = state.lagged[:, :, ordering.order[components.index].T, ancestors]
        lineage = jnp.broadcast_to(identity, shape)
    return components, Frame(
        stages=stages,
        log_probs=jnp.zeros(shape, log_weights.dtype),
        lineage=lineage,
        log_weights=log_weights,
        seen=jnp.zeros((tracker.num_partitions, ordering.order.shape[0]), bool),
        largest=resampling.component_max(log_weights, components),
        impossible=jnp.zeros((num_particles,), bool),
        equal=jnp.array(False) if tracker.gradient == "soft" else equal | ~state.weighted,
        num_invalid=jnp.zeros((), jnp.int32),
        labels=labels,
        scores=None if state.scores is None else jnp.zeros(shape, log_weights.dtype),
        offers=exchange.no_offers(shape, log_weights.dtype) if exchanging else None,
        groups=exchange.everyone(*shape) if exchanging else None,
    )


def stage_body(tracker, key, state, observation, components) -> Callable[[jax.Array, Frame], Frame]:
    """The body of the loop over stages."""
    num_particles, num_partitions = tracker.num_particles, tracker.num_partitions
    ordering = tracker.ordering
    dtype = state.lagged.dtype
    past = state.lagged.reshape(-1, num_partitions * num_particles)
    dimension = state.lagged.shape[1]
    has_parents = any(parent != -1 for parent in tracker.parents)
    parents = jnp.asarray(tracker.parents, jnp.int32)
    # Before the loop, for all stages: on a CPU a key costs as much as a gather per particle.
    keys = jax.vmap(lambda stage: jax.random.split(jax.random.fold_in(key, stage), 4))(
        jnp.arange(num_partitions)
    )

    def parent_substates(frame, partition):
        if not has_parents:
            return jnp.zeros((dimension, num_particles), dtype)
        parent = parents[partition]
        row = ordering.rank[components.index, jnp.maximum(parent, 0)]
        slot = jnp.take_along_axis(frame.lineage, row[None], axis=0)[0]
        drawn = frame.stages[0].reshape(dimension, num_partitions * num_particles)
        return jnp.where(parent >= 0, drawn[:, row * num_particles + slot], 0.0)

    def body(stage, frame: Frame) -> Frame:
        propagate_key, resample_key, exchange_key, weigh_key = keys[stage]
        partition = ordering.order[components.index, stage]
        source = partition * num_particles + frame.lineage[stage]
        left = past[:, source].reshape(2, dimension, num_particles)
        if tracker.gradient == "transport":
            left = frame.stages[:, :, stage]
        conditions = left[0], left[1], parent_substates(frame, partition)
        moved = _once(
            ordering,
            lambda: contract.propagate(
                tracker.dynamics, propagate_key, partition, *conditions
            ).astype(dtype),
            left[0],
        )
        if tracker.motion_gradient == "score":
            moved = lax.stop_gradient(moved)
        log_prob = contract.log_prob(tracker.likelihood, observation, partition, moved)
        log_prob = log_prob.astype(dtype)
        chex.assert_shape(log_prob, (num_particles,))
        invalid = jnp.isnan(log_prob) | jnp.isposinf(log_prob)
        log_prob = lax.optimization_barrier(jnp.where(invalid, -jnp.inf, log_prob))
        if tracker.motion_gradient == "score":
            log_density = contract.log_density(tracker.dynamics, partition, moved, *conditions)
            log_prob = with_gradient_of(log_prob, log_density.astype(dtype))
        if frame.scores is not None:
            score = with_gradient_of(state.scores.reshape(-1)[source], log_prob)
            frame = frame._replace(scores=frame.scores.at[stage].set(score))
        frame = frame._replace(
            stages=lax.dynamic_update_index_in_dim(
                frame.stages, jnp.stack([moved, left[0]]), stage, axis=2
            ),
            log_probs=lax.dynamic_update_index_in_dim(frame.log_probs, log_prob, stage, axis=0),
            lineage=lax.dynamic_update_index_in_dim(
                frame.lineage, jnp.arange(num_particles, dtype=jnp.int32), stage, axis=0
            ),
            num_invalid=frame.num_invalid + jnp.sum(invalid, dtype=jnp.int32),
        )
        before = frame.log_weights
        factor, offers = levels.weigh_part(tracker, weigh_key, stage, frame)
        frame = frame.absorb(factor, components, stage)

        def resample(frame):
            if tracker.gradient == "transport":
                stages, log_weights, equal = transport.blend(
                    tracker, frame.stages, frame.log_weights, components
                )
                return frame._replace(stages=stages, log_weights=log_weights, equal=equal)
            selection, largest = frame.log_weights, frame.largest
            if tracker.tempering is not None:
                possible = ~jnp.isneginf(selection)
                change = jnp.where(possible, selection - before, 0.0)
                selection = jnp.where(possible, before + tracker.tempering * change, -jnp.inf)
                largest = None
            ancestors, log_weights, equal = _resample(
                tracker, resample_key, frame.log_weights, selection, components, largest
            )
            return frame._replace(
                lineage=frame.lineage_of(ancestors),
                log_weights=log_weights,
                equal=equal,
            )

        def resample_or_not(frame):
            return lax.cond(ordering.resample_after[stage], resample, lambda frame: frame, frame)

        if num_partitions == 1:
            return barrier(frame)  # as in _choose
        if not levels.may_exchange(tracker):
            return resample_or_not(frame)
        frame = lax.cond(
            ordering.exchange_after[stage],
            lambda frame: levels.end(tracker, exchange_key, stage, resample_or_not, frame, offers),
            resample_or_not,
            frame._replace(offers=None),
        )
        return frame._replace(offers=offers)

    return body


def finish(tracker, observation, components, frame) -> tuple[ParticleState, Summary]:
    """Gather the particles, correct by the joint likelihood, normalise, and report."""
    num_particles, num_partitions = tracker.num_particles, tracker.num_partitions
    ordering = tracker.ordering
    # By partition, not by stage; a particle's draws lie in rows of its own component.
    row = _choose(
        ordering,
        _is_split(ordering),
        lambda: ordering.rank[components.index].T,
        lambda: jnp.broadcast_to(ordering.rank[0][:, None], frame.lineage.shape),
    )
    flat = frame.stages.reshape(-1, num_partitions * num_particles)
    # Without resampling or exchange inside the frame every particle kept its own draws.
    lineage, lagged = _choose(
        ordering,
        jnp.any(ordering.resample_after | ordering.exchange_after),
        lambda: _gathered(frame, flat, row),
        lambda: (
            frame.lineage,
            frame.stages if num_partitions == 1 else frame.stages[:, :, ordering.rank[0]],
        ),
    )
    scores = path = None
    if frame.scores is not None:
        scores = frame.scores.reshape(-1)[row * num_particles + lineage]
        path = jnp.sum(scores, axis=0)
    if hasattr(tracker.likelihood, "log_joint"):
        log_probs = frame.log_probs.reshape(-1)[row * num_particles + lineage]
        log_joint = jax.vmap(tracker.likelihood.log_joint, in_axes=(None, 2, 1))(
            observation, jnp.swapaxes(lagged[0], 0, 1), log_probs
        ).astype(log_probs.dtype)
        invalid = jnp.isnan(log_joint) | jnp.isposinf(log_joint)
        log_joint = jnp.where(invalid, -jnp.inf, log_joint)
        frame = frame._replace(num_invalid=frame.num_invalid + jnp.sum(invalid, dtype=jnp.int32))
        weighting = jnp.sum(jnp.where(jnp.isneginf(log_probs), 0.0, log_probs), axis=0)
        frame = frame.absorb(log_joint - weighting, components)
        if path is not None:
            path = with_gradient_of(path, log_joint - weighting)

    every_component = ordering.rank.T, jnp.arange(ordering.rank.shape[0])
    lost = ~jnp.any(frame.seen[every_component], axis=1)

    all_impossible = jnp.all(frame.impossible)
    log_weights = jnp.where(frame.impossible & ~all_impossible, -jnp.inf, frame.log_weights)
    if path is not None:
        log_weights = with_gradient_of(log_weights, path)
    log_total = jax.nn.logsumexp(log_weights)
    log_weights = _choose(
        ordering,
        ordering.literal,
        lambda: resampling.renormalised(log_weights, components),
        lambda: log_weights - log_total,
    )
    log_weights = lax.optimization_barrier(log_weights)
    if scores is not None:
        # What the weights were divided by, or a joint likelihood adds, belongs to no partition.
        rest = log_weights - jnp.sum(scores, axis=0)
        scores = with_gradient_of(scores, rest[None] / num_partitions)
    state = ParticleState(
        lagged=lagged,
        log_weights=log_weights,
        lineage=lineage,
        component=frame.labels,
        weighted=jnp.ones((), bool),
        scores=scores,
    )
    log_evidence = jnp.where(all_impossible, -jnp.inf, log_total)
    status = (
        STATUS_INVALID_LIKELIHOOD * (frame.num_invalid > 0)
        + STATUS_IMPOSSIBLE * all_impossible
        + STATUS_LOST * jnp.any(lost)
    ).astype(jnp.int32)
    return state, summarise(state, log_evidence, status, lost, frame.num_invalid)


def _choose(ordering: Ordering, predicate: jax.Array, true: Callable, false: Callable) -> Any:
    """``lax.cond``, but ``false()`` where one partition leaves an ordering no choice.

    The barrier stands in for the branch's edge: without it XLA computes what comes before
    once for every use of it.
    """
    if ordering.num_partitions == 1:
        return barrier(false())
    return lax.cond(predicate, true, false)


def _once(ordering: Ordering, function: Callable[[], jax.Array], like: jax.Array) -> jax.Array:
    """``function()``, computed once, however many things use it.

    On a CPU, XLA would rather merge it into each of its uses and compute it there again, past
    any barrier; but not past the edge of a branch that it cannot foresee.
    """
    return lax.cond(ordering.order[0, 0] >= 0, function, lambda: like)


def _is_split(ordering: Ordering) -> jax.Array:
    """Whether particles divide into components, or may do so; the same for all runs."""
    return jnp.asarray(ordering.by_label) | (ordering.fractions[0] < 1.0)


def _gathered(frame: Frame, flat: jax.Array, row: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Lineage ``[P, N]`` and substates ``[2, D, P, N]`` by partition."""
    num_particles = frame.lineage.shape[1]
    lineage = jnp.take_along_axis(frame.lineage, row, axis=0)
    lagged = flat[:, row * num_particles + lineage]
    return lineage, lagged.reshape(frame.stages.shape)


def _resample(tracker, key, log_weights, log_selection, components, largest=None):
    """Weighted resampling, adaptive if asked.

    Returns ancestors, log-weights, and whether the weights are now equal.
    """
    drawn_by, soft = log_selection, tracker.gradient == "soft"
    if soft:
        share = 0.5 if tracker.soft_share is None else tracker.soft_share
        drawn_by, largest = resampling.soft_selection(log_selection, share, components), None
    ancestors, new_log_weights = resampling.weighted_resample(
        key, log_weights, drawn_by, tracker.resampling, components, largest
    )
    if soft:
        new_log_weights = resampling.keep_total(new_log_weights, log_weights, components)
    ancestors = checkpoint_name(ancestors, ANCESTORS)
    if tracker.ess_threshold is None:
        return ancestors, new_log_weights, jnp.array(not soft)
    few_in = resampling.few_effective(log_selection, components, tracker.ess_threshold)
    few = components.spread(few_in)
    identity = jnp.arange(tracker.num_particles, dtype=jnp.int32)
    return (
        jnp.where(few, ancestors, identity),
        jnp.where(few, new_log_weights, log_weights),
        jnp.all(few) & (not soft),
    )
