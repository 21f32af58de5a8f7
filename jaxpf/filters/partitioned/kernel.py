"""The partitioned kernel: SIR, PS, DPS, SPS and branched sampling in one compiled program.

A frame has P stages, and a stage has four operations, one function each: *move* the partition that
the ordering assigns to the particle's component, *weigh* it, *exchange* parts if the ordering does,
and *select* within components.  After the last stage, *finish* reassembles the particles and
reports.  The files ``motion`` and ``weighing``, and the tracker's ``resampling`` and ``gradient``,
define how a stage draws, weights and selects.  Two ideas keep the kernel short and fast:

- *Stage rows.*  Inside a frame, row j of every array belongs to stage j, whichever partition a
  component processes there, so a stage writes one row in place.
- *Lineage instead of copies.*  Resampling moves no substates.  A particle is P integers:
  ``lineage[j]`` is the slot that drew the partition of row j or, before its stage, the particle
  of the previous frame that it continues.  Resampling and exchange permute these integers, and the
  substates are gathered once, at the end of the frame.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import chex
import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract import calls
from jaxpf.contract.state import ParticleState, Summary, sanitised
from jaxpf.filters import confidence
from jaxpf.filters.partitioned import (
    ending,
    exchange as rules,
    levels,
    motion,
    selection,
    weighing,
)
from jaxpf.filters.partitioned.carry import Carry, Drawn, Settings, Shared
from jaxpf.lowering.branches import choose, computed_before, repeated
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.lowering.integers import order_by_group
from jaxpf.lowering.threefry import key_at
from jaxpf.resampling.components import Components, component_max, components_of_sizes


def step(
    tracker: Settings, key: jax.Array, state: ParticleState, observation: Any
) -> tuple[ParticleState, Summary]:
    """Advance the weighted set by one frame."""
    begin_key, stages_key = jax.random.split(key)
    log_first_stage = calls.log_first_stage_all(tracker.likelihood, observation, state.lagged[0])
    state, components, carry = begin(tracker, begin_key, state, log_first_stage)
    shared = Shared(tracker, state, observation, components)
    # All stages' keys before the loop: on a CPU a key costs as much as a gather per particle.
    keys = jax.vmap(lambda stage: jax.random.split(jax.random.fold_in(stages_key, stage), 4))(
        jnp.arange(tracker.num_partitions)
    )

    def one_stage(stage: jax.Array, carry: Carry) -> Carry:
        move_key, select_key, exchange_key, weigh_key = key_at(keys, stage)
        before = carry.log_weights
        drawn = move(shared, move_key, stage, carry)
        carry = weigh(shared, weigh_key, stage, carry, drawn)
        chosen = partial(select, shared, select_key, stage, before)
        return exchange(shared, exchange_key, stage, carry, chosen)

    carry = repeated(tracker.num_partitions, one_stage, carry)
    label_key = jax.random.fold_in(stages_key, tracker.num_partitions)
    after = ending.finish(tracker, label_key, observation, components, carry)
    return confidence.reported(tracker.likelihood, state, *after, observation)


def begin(
    tracker: Settings,
    key: jax.Array,
    state: ParticleState,
    log_first_stage: jax.Array | None = None,
) -> tuple[ParticleState, Components, Carry]:
    """Resample all particles jointly, then split them into the ordering's components."""
    num_particles, ordering = tracker.num_particles, tracker.ordering
    select_key, split_key = jax.random.split(key)
    state, selected = selection.select_between_frames(tracker, select_key, state, log_first_stage)
    ancestors, log_weights = selected.ancestors, selected.log_weights
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    if ordering.keeps_components:
        component = (state.component if state.label is None else state.label)[ancestors]
        shuffle = order_by_group(component)
        component = component[shuffle]
        ancestors, log_weights = ancestors[shuffle], log_weights[shuffle]
        sizes = jnp.zeros((ordering.order.shape[0],), jnp.int32).at[component].add(1)
        components = components_of_sizes(sizes, num_particles)
    else:
        edges = jnp.round(jnp.cumsum(ordering.fractions) * num_particles).astype(jnp.int32)
        components = components_of_sizes(
            jnp.diff(edges, prepend=jnp.zeros((1,), jnp.int32)), num_particles
        )
        component = components.index

        def shuffled():
            shuffle = jax.random.permutation(split_key, identity)
            return ancestors[shuffle], log_weights[shuffle]

        # The order of particles matters only if they are split into components.
        ancestors, log_weights = choose(
            ordering.is_split,
            shuffled,
            lambda: (ancestors, log_weights),
            is_never_true=tracker.num_partitions == 1,
        )
    shape, exchanging = (tracker.num_partitions, num_particles), levels.may_exchange(tracker)
    stages, lineage = jnp.zeros_like(state.lagged), jnp.broadcast_to(ancestors, shape)
    if tracker.gradient.blends:
        # Blending moves substates: until its stage, a row holds the blended past.
        stages = state.lagged[:, :, ordering.order[components.index].T, ancestors]
        lineage = jnp.broadcast_to(identity, shape)
    carry = Carry(
        stages=stages,
        log_probs=jnp.zeros(shape, log_weights.dtype),
        lineage=lineage,
        log_weights=log_weights,
        log_scale=jnp.zeros((2, ordering.order.shape[0]), log_weights.dtype),
        seen=jnp.zeros((tracker.num_partitions, ordering.order.shape[0]), bool),
        largest=jnp.where(
            selected.equal,
            jnp.where(components.size > 0, -math.log(num_particles), -jnp.inf),
            component_max(log_weights, components),
        ),
        impossible=jnp.zeros((ordering.order.shape[0],), bool),
        equal=selected.equal,
        num_invalid=jnp.zeros((), jnp.int32),
        label=component if state.label is None else state.label[ancestors],
        path_scores=None if state.path_scores is None else jnp.zeros(shape, log_weights.dtype),
        sources=None if state.sources is None else jnp.zeros(shape, jnp.int32),
        selections=None if state.selections is None else selected.share,
        offers=rules.no_offers(shape, log_weights.dtype) if exchanging else None,
        groups=rules.everyone(*shape) if exchanging else None,
    )
    return state, components, carry


def move(shared: Shared, key: jax.Array, stage: jax.Array, carry: Carry) -> Drawn:
    """Draw this stage's partition of each particle, given its past and its parent."""
    tracker, lagged = shared.tracker, shared.state.lagged
    ordering, num_particles = tracker.ordering, tracker.num_particles
    partition = ordering.order[shared.components.index, stage]
    source = partition * num_particles + carry.lineage[stage]
    if tracker.gradient.blends:
        current, previous = carry.stages[:, :, stage]
    else:
        lagged = lagged.reshape(2, -1, tracker.num_partitions * num_particles)
        # Apart: motion may use the first alone.
        current, previous = lagged[0][:, source], lagged[1][:, source]
    past = current, previous, _parent_substates(shared, partition, carry)
    others = (_whole_past(shared, stage, carry),) if calls.is_coupled(tracker.dynamics) else ()
    return Drawn(partition, source, current, *motion.draw(shared, key, partition, past, others))


def weigh(shared: Shared, key: jax.Array, stage: jax.Array, carry: Carry, drawn: Drawn) -> Carry:
    """Multiply the weights by the likelihood of the draws, and prepare their exchange."""
    tracker = shared.tracker
    log_prob = weighing.log_factor(shared, stage, carry, drawn)
    log_prob = log_prob.astype(drawn.substates.dtype)
    chex.assert_shape(log_prob, (tracker.num_particles,))
    log_prob, num_invalid = sanitised(log_prob)
    log_prob = computed_before(log_prob)
    log_factor, log_scale = carry.relative(log_prob, shared.components)
    if drawn.log_weight is not None:
        log_weight, more = sanitised(drawn.log_weight)
        log_factor, num_invalid = computed_before(log_factor + log_weight), num_invalid + more
    if drawn.score is not None:
        log_factor = with_gradient_of(log_factor, drawn.score)
    if carry.sources is not None:
        carry = carry.write(stage, sources=carry.lineage[stage])
    carry = carry.write(
        stage,
        stages=jnp.stack([drawn.substates, drawn.previous]),
        log_probs=log_prob,
        lineage=jnp.arange(tracker.num_particles, dtype=jnp.int32),
    )
    if shared.state.path_scores is not None:
        score = with_gradient_of(shared.state.path_scores.reshape(-1)[drawn.source], log_factor)
        carry = carry.write(stage, path_scores=score)
    carry = carry._replace(num_invalid=carry.num_invalid + num_invalid)
    log_factor, offers = levels.weigh_part(tracker, key, stage, carry, log_factor)
    carry = carry.multiplied(log_factor, log_scale, shared.components, stage)
    return carry._replace(offers=offers)


def select(
    shared: Shared, key: jax.Array, stage: jax.Array, before: jax.Array, carry: Carry
) -> Carry:
    """Resample within components, if the ordering resamples after this stage.

    ``before``, ``[N]``, are the log-weights before the stage.
    """
    tracker = shared.tracker
    return choose(
        tracker.ordering.resample_after[stage],
        lambda: selection.select(tracker, key, carry, before, shared.components),
        lambda: carry,
        cheap=not tracker.gradient.blends,
    )


def exchange(
    shared: Shared,
    key: jax.Array,
    stage: jax.Array,
    carry: Carry,
    select: Callable[[Carry], Carry],
) -> Carry:
    """Select, and exchange the parts of a level that ends with this stage."""
    tracker = shared.tracker
    if tracker.num_partitions == 1:
        return computed_before(carry)  # no later stage needs a selection
    if not levels.may_exchange(tracker):
        return select(carry)
    # Offers do not change, so the branches need not return them.
    offers, carry = carry.offers, carry._replace(offers=None)
    carry = lax.cond(
        tracker.ordering.exchange_after[stage],
        lambda carry: levels.end(tracker, key, stage, select, carry, offers),
        select,
        carry,
    )
    return carry._replace(offers=offers)


def _parent_substates(shared: Shared, partition: jax.Array, carry: Carry) -> jax.Array:
    """Parents' substates ``[D, N]`` from an earlier stage of this frame; zeros for a root."""
    tracker, ordering = shared.tracker, shared.tracker.ordering
    dimension, num_particles = carry.stages.shape[1], tracker.num_particles
    if all(parent == -1 for parent in tracker.parents):
        return jnp.zeros((dimension, num_particles), carry.stages.dtype)
    parent = jnp.asarray(tracker.parents, jnp.int32)[partition]
    row = ordering.rank[shared.components.index, jnp.maximum(parent, 0)]
    slot = jnp.take_along_axis(carry.lineage, row[None], axis=0)[0]
    drawn = carry.stages[0].reshape(dimension, -1)
    return jnp.where(parent >= 0, drawn[:, row * num_particles + slot], 0.0)


def _whole_past(shared: Shared, stage: jax.Array, carry: Carry) -> jax.Array:
    """All partitions' substates of the previous frame, ``[P, D, N]``, moved since or not."""
    ordering, num_partitions = shared.tracker.ordering, shared.tracker.num_partitions
    left, ahead = carry.stages[1], carry.stages[0]
    if not shared.tracker.gradient.blends:
        partition = ordering.order[shared.components.index].T  # [P, N], partition of each row
        past = shared.state.lagged[0]
        ahead = past[:, partition, carry.lineage]
        left = left[:, jnp.arange(num_partitions)[:, None], carry.lineage]
    rows = jnp.where(jnp.arange(num_partitions)[:, None] < stage, left, ahead)
    rank = ordering.rank[shared.components.index].T  # [P, N], row of each partition
    return jnp.swapaxes(jnp.take_along_axis(rows, rank[None], axis=1), 0, 1)
