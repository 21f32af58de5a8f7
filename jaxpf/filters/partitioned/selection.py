"""Selection: resample particles and correct their weights.

The tracker's settings choose the scheme (``jaxpf.resampling``), adaptive or unconditional
resampling, tempering of the weights, and the gradient strategy (``jaxpf.gradients``).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.ad_checkpoint import checkpoint_name

from jaxpf.contract.state import ParticleState
from jaxpf.filters.partitioned.carry import Carry, Settings
from jaxpf.resampling import weighted
from jaxpf.resampling.components import Components, few_effective, one_component

#: Name under which ``jax.checkpoint`` may keep ancestors: small, but slow to recompute.
ANCESTORS = "ancestors"


class Selected(NamedTuple):
    """Result of a selection.

    Attributes:
        ancestors: ``[N]`` int32, ancestor of each slot.
        log_weights: ``[N]``, new log-weight of each slot.
        equal: ``[]`` bool, whether the weights are now equal.
        share: ``[]``, share of the slots that were resampled; can be below 1 if adaptive.
    """

    ancestors: jax.Array
    log_weights: jax.Array
    equal: jax.Array
    share: jax.Array


def select_between_frames(
    tracker: Settings,
    key: jax.Array,
    state: ParticleState,
    log_first_stage: jax.Array | None = None,
) -> tuple[ParticleState, Selected]:
    """Select among all particles of the previous frame; also return that state, maybe blended.

    The initial set has equal weights: resampling it would only lose particles.

    With ``log_first_stage``, ``[N]``, particles are selected by weight times first-stage
    weight, which is then divided out of the weights (auxiliary particle filter, Pitt & Shephard
    1999).
    """
    gradient: Any = tracker.gradient
    if gradient.blends:
        state = gradient.blend_state(state, tracker.ess_threshold)
    incoming = state.log_weights
    if state.path_scores is not None:
        incoming = lax.stop_gradient(incoming)  # the scores hold their derivative
    whole = one_component(tracker.num_particles)
    selection = incoming if log_first_stage is None else incoming + log_first_stage
    ancestors, log_weights, equal, share = resample(tracker, key, incoming, selection, whole)
    equal &= log_first_stage is None
    uniform = jnp.full_like(log_weights, -np.log(tracker.num_particles))
    return state, Selected(
        ancestors=jnp.where(state.weighted, ancestors, _slots(tracker)),
        log_weights=jnp.where(state.weighted & ~equal, log_weights, uniform),
        equal=equal | ~state.weighted,
        share=jnp.where(state.weighted, share, 1.0),  # draws of the first frame are independent
    )


def select(
    tracker: Settings,
    key: jax.Array,
    carry: Carry,
    before: jax.Array,
    components: Components,
) -> Carry:
    """Select within components after a stage; ``before`` are the log-weights before the stage."""
    gradient: Any = tracker.gradient
    if gradient.blends:
        stages, log_weights, equal = gradient.blend(
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
    ancestors, log_weights, equal, share = resample(
        tracker, key, carry.log_weights, selection, components, largest
    )
    if carry.selections is not None:
        carry = carry._replace(selections=carry.selections + share)
    if tracker.initial_label is not None:
        carry = carry._replace(label=carry.label[ancestors])
    return carry._replace(lineage=carry.lineage_of(ancestors), log_weights=log_weights, equal=equal)


def resample(
    tracker: Settings,
    key: jax.Array,
    log_weights: jax.Array,
    log_selection: jax.Array,
    components: Components,
    largest: jax.Array | None = None,
) -> Selected:
    """Weighted resampling in triggered components; see ``resampling.weighted_resample``."""
    drawn_by = tracker.gradient.selection(log_selection, components)
    if drawn_by is not log_selection:
        largest = None
    ancestors, new_log_weights = weighted.weighted_resample(
        key, log_weights, drawn_by, tracker.resampling, components, largest
    )
    new_log_weights = tracker.gradient.selected(new_log_weights, log_weights, components)
    ancestors = checkpoint_name(ancestors, ANCESTORS)
    if tracker.ess_threshold is None:
        everyone = jnp.ones((), log_weights.dtype)
        equal = jnp.array(tracker.gradient.equalises)
        return Selected(ancestors, new_log_weights, equal, everyone)
    here = components.spread(few_effective(log_selection, components, tracker.ess_threshold))
    return Selected(
        ancestors=jnp.where(here, ancestors, _slots(tracker)),
        log_weights=jnp.where(here, new_log_weights, log_weights),
        equal=jnp.all(here) & tracker.gradient.equalises,
        share=jnp.mean(here, dtype=log_weights.dtype),
    )


def _slots(tracker: Settings) -> jax.Array:
    return jnp.arange(tracker.num_particles, dtype=jnp.int32)
