"""Discrete labels of particles.

Labels are drawn at the start, follow their particles through every selection, and move at the end
of a frame.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.state import sanitised
from jaxpf.filters.partitioned.carry import Carry, Settings
from jaxpf.resampling.components import Components


def draw_first(tracker: Settings, key: jax.Array, dtype) -> tuple[jax.Array, jax.Array]:
    """Draw labels ``[N]`` just before the first frame, with their log-probabilities ``[N]``."""
    log_probabilities = jnp.log(jnp.asarray(tracker.initial_label, dtype))
    label = jax.random.categorical(key, log_probabilities, shape=(tracker.num_particles,))
    return label.astype(jnp.int32), jax.nn.log_softmax(log_probabilities)[label]


def move(
    tracker: Settings, key: jax.Array, label: jax.Array, substates: jax.Array
) -> tuple[jax.Array, jax.Array | None]:
    """Move labels ``[N]`` given the new substates ``[D, P, N]`` (maccormick1999, section 4).

    Also returns the log-probability ``[N]`` of each move, for derivatives; None if it is unknown or
    labels do not move.
    """
    dynamics: Any = tracker.dynamics
    moved = calls.propagate_label_all(dynamics, key, label, substates)
    if not optional(dynamics, "propagate_label") or not calls.has_log_label(dynamics):
        return moved, None
    score = jax.vmap(dynamics.log_label, in_axes=(0, 0, 2))(
        moved, label, jnp.swapaxes(substates, 0, 1)
    )
    return moved, score.astype(substates.dtype)


def weigh(tracker: Settings, label: jax.Array, carry: Carry, components: Components) -> Carry:
    """Make particles impossible whose labels ``[N]`` were moved outside of 0 to L - 1."""
    if not optional(tracker.dynamics, "propagate_label"):
        return carry
    outside = (label < 0) | (label >= jnp.shape(tracker.initial_label)[0])
    log_factor = jnp.where(outside, jnp.nan, jnp.zeros_like(carry.log_weights))
    log_factor, num_invalid = sanitised(log_factor)
    carry = carry._replace(num_invalid=carry.num_invalid + num_invalid)
    return carry.multiplied(log_factor, jnp.zeros_like(carry.largest), components)


def probabilities(tracker: Settings, label: jax.Array, log_weights: jax.Array) -> jax.Array:
    """Total weight ``[L]`` of the particles with each label."""
    is_label = label == jnp.arange(jnp.shape(tracker.initial_label)[0])[:, None]
    return is_label.astype(log_weights.dtype) @ jnp.exp(log_weights)


def check(tracker: Settings) -> None:
    """Refuse labels that are malformed, or are missing although required."""
    likelihood, given = tracker.likelihood, tracker.initial_label
    if given is None:
        labelled = optional(likelihood, "log_joint_labelled")
        if labelled and not optional(likelihood, "log_joint"):
            raise InputError(
                "the likelihood's log_joint_labelled needs labels; give initial_label, the "
                "probabilities of each label, or define log_joint as well."
            )
    elif is_concrete(given):
        values = np.asarray(given)
        if not (values >= 0).all() or not np.isclose(values.sum(), 1, atol=1e-4):
            raise InputError(
                f"initial_label {values.tolist()} must hold probabilities: at least 0, and 1 "
                "together."
            )
