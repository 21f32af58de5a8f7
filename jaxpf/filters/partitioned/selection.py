"""Who goes on: all that draws, blends or keeps a derivative stands behind ``select``.

A selection follows the frame's settings: a scheme of ``jaxpf.resampling``, adaptive or not
(``ess_threshold``), by weights or by tempered ones (``tempering``), and what it passes on to a
derivative (``jaxpf.gradients``).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.ad_checkpoint import checkpoint_name

from jaxpf.contract.state import ParticleState
from jaxpf.filters.partitioned.carry import Carry
from jaxpf.resampling import weighted
from jaxpf.resampling.components import Components, few_effective, one_component

#: Name by which ``jax.checkpoint`` may keep ancestors: few bytes, and dear to compute again.
ANCESTORS = "ancestors"


class Selected(NamedTuple):
    """Outcome of a selection.

    Attributes:
        ancestors: ``[N]`` int32, whom each slot goes on from.
        log_weights: ``[N]``, of the slots.
        equal: ``[]`` bool, the weights are equal now.
    """

    ancestors: jax.Array
    log_weights: jax.Array
    equal: jax.Array


def select_between_frames(
    tracker: Any, key: jax.Array, state: ParticleState
) -> tuple[ParticleState, Selected]:
    """Select among all particles of the frame before; also returns these, blended if need be.

    A set that was only drawn has equal weights already: to resample it would lose particles.
    """
    if tracker.gradient.blends:
        state = tracker.gradient.blend_state(state, tracker.ess_threshold)
    incoming = state.log_weights
    if state.path_scores is not None:
        incoming = lax.stop_gradient(incoming)  # the scores hold their derivative
    whole = one_component(tracker.num_particles)
    ancestors, log_weights, equal = resample(tracker, key, incoming, incoming, whole)
    uniform = jnp.full_like(log_weights, -np.log(tracker.num_particles))
    return state, Selected(
        ancestors=jnp.where(state.weighted, ancestors, _themselves(tracker)),
        log_weights=jnp.where(state.weighted & ~equal, log_weights, uniform),
        equal=equal | ~state.weighted,
    )


def select(
    tracker: Any, key: jax.Array, carry: Carry, before: jax.Array, components: Components
) -> Carry:
    """Select within components after a stage, which multiplied the weights ``before`` it."""
    if tracker.gradient.blends:
        stages, log_weights, equal = tracker.gradient.blend(
            carry.stages, carry.log_weights, components, tracker.ess_threshold
        )
        return carry._replace(stages=stages, log_weights=log_weights, equal=equal)
    selection: jax.Array = carry.log_weights
    largest: jax.Array | None = carry.largest
    if tracker.tempering is not None:
        possible = ~jnp.isneginf(selection)
        change = jnp.where(possible, selection - before, 0.0)
        selection = jnp.where(possible, before + tracker.tempering * change, -jnp.inf)
        largest = None
    ancestors, log_weights, equal = resample(
        tracker, key, carry.log_weights, selection, components, largest
    )
    if tracker.initial_label is not None:
        carry = carry._replace(label=carry.label[ancestors])
    return carry._replace(lineage=carry.lineage_of(ancestors), log_weights=log_weights, equal=equal)


def resample(
    tracker: Any,
    key: jax.Array,
    log_weights: jax.Array,
    log_selection: jax.Array,
    components: Components,
    largest: jax.Array | None = None,
) -> Selected:
    """Weighted resampling, adaptive if asked; see ``resampling.weighted_resample``."""
    drawn_by = tracker.gradient.selection(log_selection, components)
    if drawn_by is not log_selection:
        largest = None
    ancestors, new_log_weights = weighted.weighted_resample(
        key, log_weights, drawn_by, tracker.resampling, components, largest
    )
    new_log_weights = tracker.gradient.selected(new_log_weights, log_weights, components)
    ancestors = checkpoint_name(ancestors, ANCESTORS)
    if tracker.ess_threshold is None:
        return Selected(ancestors, new_log_weights, jnp.array(tracker.gradient.equalises))
    few_in = few_effective(log_selection, components, tracker.ess_threshold)
    few = components.spread(few_in)
    return Selected(
        ancestors=jnp.where(few, ancestors, _themselves(tracker)),
        log_weights=jnp.where(few, new_log_weights, log_weights),
        equal=jnp.all(few) & tracker.gradient.equalises,
    )


def _themselves(tracker: Any) -> jax.Array:
    return jnp.arange(tracker.num_particles, dtype=jnp.int32)
