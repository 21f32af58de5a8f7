"""Open populations: add and remove targets between frames.

A tracker with ``population="open"`` has a fixed number L of slots, so adding or removing targets
does not recompile.  ``LabelledState.alive`` marks the slots that hold a target.  An empty slot has
no weight, no share in eq. 4 and no part in the mixture, and after the next resampling it has no
particles: the living targets share all N.

A new target gets its particles in the next frame, after resampling, when weights are equal within
each label.  It gets its fair share ``N / living``, taken evenly from the other labels.  The
particles start at its own place, like those of ``initial``.

A new target has no evidence yet, so its mass in the mixture is 1 / living and the others' masses
shrink in proportion.  If all particles of a target have zero likelihood in a frame, the frame is
skipped for its mass and its particles: both stay unchanged, and the others share the rest.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.logs import normalised
from jaxpf.filters.labelled import by_label
from jaxpf.filters.labelled.state import LabelledState, Settings
from jaxpf.lowering.programs import compiled


@compiled
def add_target(state: LabelledState, slot: jax.Array, substate: jax.Array) -> LabelledState:
    """Add a target to an open population between two frames; it gets particles in the next frame.

    Args:
        state: state after the last frame.
        slot: ``[]`` int, an empty slot.  If it is occupied, its target moves to the new place.
        substate: ``[D]``, the target's substate in the last frame.
    """
    alive = state.alive.at[slot].set(True)
    living = jnp.sum(alive).astype(state.log_mass.dtype)
    others = normalised(state.log_mass.at[slot].set(-jnp.inf))[0] + jnp.log1p(-1 / living)
    return dataclasses.replace(
        state,
        alive=alive,
        newborn=state.newborn.at[slot].set(True),
        lost=state.lost.at[slot].set(False),
        estimate=state.estimate.at[:, slot].set(jnp.asarray(substate, state.estimate.dtype)),
        velocity=state.velocity.at[:, slot].set(0.0),
        log_mass=others.at[slot].set(-jnp.log(living)),
    )


@compiled
def remove_target(state: LabelledState, slot: jax.Array) -> LabelledState:
    """Remove the target of ``slot`` from an open population between two frames.

    The other labels' particles do not change.
    """
    weights = jnp.where(state.labels == slot, -jnp.inf, state.log_weights)
    return dataclasses.replace(
        state,
        alive=state.alive.at[slot].set(False),
        newborn=state.newborn.at[slot].set(False),
        lost=state.lost.at[slot].set(False),
        log_weights=normalised(weights)[0],
        log_mass=normalised(state.log_mass.at[slot].set(-jnp.inf))[0],
    )


def first_state(tracker: Settings) -> LabelledState:
    """Build the state just before the first frame; a row of NaN in ``initial`` is an empty slot."""
    initial, num_particles = tracker.initial.T, tracker.num_particles
    alive = jnp.all(jnp.isfinite(initial), axis=0)
    place = jnp.where(alive, initial, 0.0)
    labels = jnp.sort(assign_slots(alive, num_particles))
    sizes = by_label.counts(labels, tracker.num_partitions).astype(place.dtype)
    mass = jnp.where(alive, -jnp.log(jnp.maximum(jnp.sum(alive), 1).astype(place.dtype)), -jnp.inf)
    values = by_label.broadcast(place, labels)
    velocity = jnp.zeros((len(tracker.position), tracker.num_partitions), place.dtype)
    if tracker.speed is not None:
        velocity = place[jnp.array(tracker.speed)]
    return LabelledState(
        lagged=jnp.stack([values, values]),
        labels=labels,
        log_weights=by_label.broadcast(mass - jnp.log(jnp.maximum(sizes, 1)), labels),
        log_mass=mass,
        estimate=place,
        velocity=velocity,
        lost=jnp.zeros_like(alive),
        weighted=jnp.zeros((), bool),
        alive=alive,
        newborn=jnp.zeros_like(alive),
        time=jnp.zeros((), jnp.int32),
    )


def with_newborn(tracker: Settings, state: LabelledState) -> LabelledState:
    """Give newborn targets their first particles, each at its own place.

    The slots are assigned in turn, so that all labels give up particles evenly.  ``state`` is that
    after ``kernel.select``: weights are equal within a label.
    """
    velocity = state.velocity
    if tracker.speed is not None:  # given with the place
        given = state.estimate[jnp.array(tracker.speed)]
        velocity = jnp.where(state.newborn, given, velocity)
    label = assign_slots(state.alive, tracker.num_particles)
    is_newborn = by_label.broadcast(state.newborn, label)
    uniform = jnp.full_like(state.log_weights, -np.log(tracker.num_particles))
    return dataclasses.replace(
        state,
        lagged=jnp.where(is_newborn, by_label.broadcast(state.estimate, label), state.lagged),
        labels=jnp.where(is_newborn, label, state.labels),
        log_weights=jnp.where(is_newborn, uniform, state.log_weights),
        velocity=velocity,
        newborn=jnp.zeros_like(state.newborn),
    )


def assign_slots(alive: jax.Array, num_particles: int) -> jax.Array:
    """Assign the living labels to the N slots in turn: ``[N]`` int32."""
    living_first = jnp.argsort(~jnp.asarray(alive, bool)).astype(jnp.int32)
    number = jnp.maximum(jnp.sum(alive), 1)
    return living_first[jnp.arange(num_particles, dtype=jnp.int32) % number]
