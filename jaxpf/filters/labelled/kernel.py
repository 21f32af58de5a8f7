"""One frame of the labelled filter: resample, move, weight, and normalise by label (rowe2005).

The set is a particle filter for a *mixture*: each particle draws a label once, with equal
probability, and then follows that target.  Its evidence is ``(1/L) sum_l Z_l``, and a label keeps
particles in proportion to its share of that sum.  The rules for ``weights`` are unbiased at any
number of particles in the following sense.  E is over runs, W_l is label l's weight, N_l the number
of its particles, Z^ the product of the frames' ``exp(log_evidence)``.

``plain``
    ``E[L Z^ W_l] = Z_l``, and the same with any function of the substates.  A label can lose all
    its particles permanently: in 1.2 % of the runs of the table of biases (3 frames, 16 particles,
    2 targets), in every run on rowe2005's scene (300 frames, 100 particles).
``corrected``
    Selects by eq. 4 and divides the weights by it: the same expectations, and each label gets a
    fair share of the particles.
``equal_share``
    Eq. 4 as printed: every label's weights sum to 1/L.  N_l then does not depend on the
    particles' weights, and given the N_l each label is a separate ordinary filter.  With ``M_l``
    the product over frames of the mean of its likelihoods, ``E[M_l] = Z_l`` as long as no label
    is empty.  With multinomial resampling, labels are independent given the N_l, so products over
    labels are unbiased too.  A target's mass in the mixture is stored separately from the
    weights, as ``M_l / sum(M)``.

A label whose particles all have zero likelihood is reported as lost.  With equal shares, the frame
is skipped for that label and its particles continue; otherwise its weight stays zero.

Regularised estimates and feedback of the speed follow eq. 5-6.  With x and u a target's estimated
position and speed, and a_x, a_u the rates of ``regularise``::

    x_t = (1 - a_x) (x_{t-1} + u_{t-1}) + a_x sum(w x^) / sum(w)
    u_t = (1 - a_u) u_{t-1} + a_u (x_t - x_{t-1})

Time is counted in frames.  As printed, eq. 6 divides the sum of eq. 4's weights by N_l, which is
off by a factor 1 / (L N_l), and omits the division of the speed by the time step.
"""

import dataclasses
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract.logs import counted, finite, normalised
from jaxpf.contract.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_WITHOUT_LIKELIHOOD,
    moments,
    sanitised,
)
from jaxpf.filters.labelled import by_label
from jaxpf.filters.labelled.state import LabelledState, LabelledSummary, Settings
from jaxpf.lowering.branches import computed_before
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.resampling import weighted
from jaxpf.resampling.components import one_component


def first_labels(num_particles: int, num_targets: int) -> np.ndarray:
    """Initial labels ``[N]``: contiguous runs whose lengths differ by at most one."""
    return (np.arange(num_particles) * num_targets // num_particles).astype(np.int32)


def select(tracker: Settings, key: jax.Array, state: LabelledState) -> LabelledState:
    """Resample across labels, at the start of the frame."""
    num_particles = tracker.num_particles
    incoming = state.log_weights
    selection = incoming
    if tracker.weights == "corrected":
        mass = jnp.where(jnp.isneginf(state.log_mass), 0.0, state.log_mass)
        selection = incoming - by_label.broadcast(mass, state.labels)
    chosen, log_weights = weighted.weighted_resample(
        key, incoming, selection, tracker.resampling, one_component(num_particles)
    )
    # The initial set has equal weights: resampling it would only lose particles.
    chosen = jnp.where(state.weighted, chosen, jnp.arange(num_particles, dtype=jnp.int32))
    log_weights = jnp.where(state.weighted, log_weights, incoming)
    if tracker.gradient.keeps_scores:
        log_weights = with_gradient_of(lax.stop_gradient(log_weights), incoming[chosen])
    labels = state.labels if tracker.num_partitions == 1 else state.labels[chosen]
    return dataclasses.replace(
        state, lagged=state.lagged[:, :, chosen], labels=labels, log_weights=log_weights
    )


def move(
    tracker: Settings, key: jax.Array, state: LabelledState
) -> tuple[LabelledState, jax.Array]:
    """Propagate all particles; return the new state and the previous lags ``[2, D, N]``.

    With feedback, dynamics that take the speed from ``current - previous`` find the label's
    estimated speed there.  Particles that hold a speed move by it, and their new speed starts from
    the label's instead of their own (eq. 5), which has already moved their position: what the
    dynamics change of it, mainly its noise, is kept.
    """
    left, fed_back = state.lagged, tracker.feedback == "estimate"
    velocity = by_label.broadcast(state.velocity, state.labels)
    if fed_back and tracker.speed is None:
        rows = jnp.asarray(tracker.position)
        left = left.at[1, rows].set(left[0, rows] - velocity)
    # Targets have no parents.
    moved = contract.propagate_all(
        tracker.dynamics, key, state.labels, left[0], left[1], jnp.zeros_like(left[0])
    ).astype(left.dtype)
    if fed_back and tracker.speed is not None:
        rows = jnp.asarray(tracker.speed)
        moved = moved.at[rows].add(velocity - left[0, rows])
    if tracker.motion_gradient == "score":
        moved = lax.stop_gradient(moved)
    return dataclasses.replace(state, lagged=jnp.stack([moved, left[0]])), left


def weigh(
    tracker: Settings, state: LabelledState, left: jax.Array, observation: Any
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Log-likelihoods of ``state.lagged[0]``, and the number of invalid ones, ``[]``.

    They are ``[N]``, relative to the largest of their label, ``[L]``, which is returned next.
    """
    moved = state.lagged[0]
    log_prob = contract.log_prob_all(tracker.likelihood, observation, state.labels, moved)
    chex.assert_shape(log_prob, (tracker.num_particles,))
    log_prob, num_invalid = sanitised(log_prob.astype(moved.dtype))
    log_prob = lax.optimization_barrier(log_prob)
    if tracker.motion_gradient == "score":
        log_density = contract.log_density_all(
            tracker.dynamics, state.labels, moved, left[0], left[1], jnp.zeros_like(moved)
        )
        log_prob = with_gradient_of(log_prob, log_density.astype(moved.dtype))
    alive, num_targets = counted(log_prob, state.log_weights), tracker.num_partitions
    largest = finite(by_label.maxima(alive, state.labels, num_targets))
    return log_prob - by_label.broadcast(largest, state.labels), largest, num_invalid


def share_out(
    tracker: Settings, state: LabelledState, log_factor: jax.Array, largest: jax.Array
) -> tuple[LabelledState, jax.Array, jax.Array]:
    """Multiply the weights by a factor and normalise, with or without eq. 4.

    Args:
        tracker: the tracker.
        state: the state before.
        log_factor: ``[N]``, relative to ``largest``.
        largest: ``[L]``, log of each label's part of the factor.

    Returns:
        The state with new weights and masses, and the log of the frame's evidence factors: of the
        mixture ``[]`` and of each label ``[L]``.
    """
    labels, num_targets = state.labels, tracker.num_partitions
    entering = state.log_weights
    weighed = entering + log_factor
    total = by_label.log_sums(weighed, labels, num_targets)
    seen = ~jnp.isneginf(total)
    most = finite(jnp.max(jnp.where(seen, largest, -jnp.inf)))
    apart = largest - most
    if tracker.weights == "equal_share":
        before = by_label.log_sums(lax.stop_gradient(entering), labels, num_targets)
        factor = jnp.where(seen, total - jnp.where(seen, before, 0.0), -jnp.inf)
        present = ~jnp.isneginf(before)
        # A label with zero likelihood keeps its weights: the frame is skipped for it.
        kept = by_label.broadcast(seen, labels)
        norm = jnp.where(seen, total, jnp.where(present, before, 0.0))
        num_present = jnp.maximum(jnp.sum(present), 1).astype(norm.dtype)
        log_weights = jnp.where(kept, weighed, entering) - by_label.broadcast(norm, labels)
        log_weights = log_weights - jnp.log(num_present)
        mass, log_total = normalised(state.log_mass + (factor + apart))
        log_mass = jnp.where(jnp.isneginf(log_total), state.log_mass, mass)
        if state.alive is not None:
            # Skip the frame for its mass too: it must count again once the others have ended.
            unseen = state.alive & ~seen
            share = jnp.sum(jnp.where(unseen, jnp.exp(state.log_mass), 0.0))
            rest = jnp.log1p(-jnp.minimum(share, 1 - jnp.finfo(share.dtype).eps))
            log_mass = jnp.where(unseen, state.log_mass, log_mass + rest)
    else:
        before = state.log_mass
        alive = seen & ~jnp.isneginf(before)
        factor = jnp.where(alive, total - jnp.where(alive, before, 0.0), -jnp.inf)
        # Skip an observation that is impossible for all labels.
        possible = jnp.any(seen)
        log_weights, log_total = normalised(
            jnp.where(possible, weighed + by_label.broadcast(apart, labels), entering)
        )
        log_mass = by_label.log_sums(log_weights, labels, num_targets)
        log_total = jnp.where(possible, log_total, -jnp.inf)
    state = dataclasses.replace(
        state,
        log_weights=lax.optimization_barrier(log_weights),
        log_mass=log_mass,
        lost=~seen,
        weighted=jnp.ones((), bool),
    )
    return state, log_total + most, factor + largest


def report(
    tracker: Settings,
    state: LabelledState,
    log_evidence: jax.Array,
    label_log_evidence: jax.Array,
    num_invalid: jax.Array,
) -> tuple[LabelledState, LabelledSummary]:
    """Report the labels' estimates, spreads and effective sample sizes."""
    labels, num_targets = state.labels, tracker.num_partitions
    log_weights = state.log_weights
    log_share = by_label.log_sums(log_weights, labels, num_targets)
    present = ~jnp.isneginf(log_share)
    alive = ~jnp.isneginf(log_weights)
    reference = by_label.broadcast(jnp.where(present, log_share, 0.0), labels)
    share = jnp.where(alive, jnp.exp(jnp.where(alive, log_weights - reference, 0.0)), 0.0)
    # The weighted mean of the weights is the sum of their squares.
    mean, spread = moments(
        jnp.concatenate([state.lagged[0], share[None]]),
        share,
        lambda values, weights: by_label.sums(values * weights, labels, num_targets),
        lambda mean: by_label.broadcast(mean, labels),
    )
    mean, spread, squares = mean[:-1], spread[:-1], mean[-1]
    if tracker.feedback == "none" and tracker.regularise is None:
        estimate, velocity = jnp.where(present, mean, state.estimate), state.velocity
    else:
        estimate, velocity = _regularised(tracker, state, mean, present)
    ess_parts = 1.0 / jnp.where(present & ~state.lost, squares, jnp.inf)
    lost = state.lost if state.alive is None else state.lost & state.alive
    empty = jnp.zeros_like(lost) if state.alive is None else ~state.alive
    status = (
        STATUS_INVALID_LIKELIHOOD * (num_invalid > 0)
        + STATUS_IMPOSSIBLE * (jnp.all(lost | empty) & ~jnp.all(empty))
        + STATUS_WITHOUT_LIKELIHOOD * jnp.any(lost)
    ).astype(jnp.int32)
    holders = by_label.counts(labels, num_targets).astype(log_weights.dtype)
    summary = LabelledSummary(
        estimate=estimate.T,
        log_evidence=log_evidence,
        ess=jnp.min(ess_parts),
        distinct_share=holders / tracker.num_particles,
        spread=spread.T,
        status=status,
        without_likelihood=lost,
        num_invalid=num_invalid,
        ess_parts=ess_parts,
        label_log_evidence=label_log_evidence,
    )
    state = dataclasses.replace(state, estimate=estimate, velocity=velocity, lost=lost)
    return state, computed_before(
        summary if state.alive is None else _of_living(state.alive, summary)
    )


def _of_living(alive: jax.Array, summary: Any) -> LabelledSummary:
    """Mask the empty slots in the summary of an open population."""
    smallest = jnp.min(jnp.where(alive, summary.ess_parts, jnp.inf))
    return dataclasses.replace(
        summary,
        estimate=jnp.where(alive[:, None], summary.estimate, jnp.nan),
        spread=jnp.where(alive[:, None], summary.spread, jnp.nan),
        ess=jnp.where(jnp.any(alive), smallest, 0.0),
        log_evidence=jnp.where(jnp.any(alive), summary.log_evidence, 0.0),
        alive=alive,
    )


def _regularised(
    tracker: Settings, state: LabelledState, mean: jax.Array, present: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Estimates ``[D, L]`` and speeds ``[E, L]``, from the last frame's (rowe2005, eq. 6).

    Args:
        tracker: without ``regularise``, both rates are 1.
        state: holds the last frame's estimates and speeds.
        mean: ``[D, L]``, this frame's weighted means.
        present: ``[L]`` bool; a label without weight coasts at its speed.
    """
    rows, rates = jnp.asarray(tracker.position), tracker.regularise
    along, change = (1.0, 1.0) if rates is None else jnp.asarray(rates, mean.dtype)
    before, velocity = state.estimate[rows], state.velocity
    predicted = before + velocity
    moved = jnp.where(present, (1 - along) * predicted + along * mean[rows], predicted)
    velocity = jnp.where(
        present, (1 - change) * velocity + change * (moved - before), velocity
    ).astype(mean.dtype)
    reported = jnp.where(present, mean, state.estimate).at[rows].set(moved)
    if tracker.speed is not None:
        reported = reported.at[jnp.asarray(tracker.speed)].set(velocity)
    return reported, velocity
