"""Weighted sets of particles, one per partition, and the operations of both factored filters.

Values are ``[D, P, K]`` and weights ``[P, K]``, with particles on the last axis.  Each partition
has its own random keys, so partitions do not affect each other.
"""

import math
from typing import Any, Protocol

import chex
import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract import logs
from jaxpf.contract.calls import look_near
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_WITHOUT_LIKELIHOOD,
    Presence,
    Summary,
    moments,
    sanitised,
)
from jaxpf.contract.types import HoldsModel, Initial
from jaxpf.filters import confidence
from jaxpf.filters.initial import as_floats
from jaxpf.resampling import weighted as resampling


class Factored(HoldsModel, Protocol):
    """What these operations read of a factored filter."""

    @property
    def num_particles(self) -> int:
        """Of each partition, before upsampling."""

    @property
    def upsampling(self) -> int:
        """Number of moves per particle."""

    @property
    def resampling(self) -> Any:
        """The scheme."""


@pytree_dataclass
class FactoredState:
    """P weighted sets of K particles of D dimensions.

    Attributes:
        lagged: ``[2, D, P, K]``, the substates of the current and the previous frame.
        log_weights: ``[P, K]``, normalised for each partition.
        weighted: ``[]`` bool, false for initial sets that have not been weighted.
        history: data from earlier frames, for trackers that need it; else None.
        presence: whether objects are at their estimates; None without ``log_odds`` of a likelihood.
        time: ``[]`` int32, number of frames processed, see ``jaxpf.contract.Tracker``.
    """

    lagged: jax.Array
    log_weights: jax.Array
    weighted: jax.Array
    history: Any = None
    presence: Presence | None = None
    time: jax.Array | None = None

    @property
    def substates(self) -> jax.Array:
        """Current substates, ``[..., K, P, D]``, with weights ``log_weights``, ``[..., P, K]``.

        Particles with the same index in two partitions are unrelated.
        """
        return jnp.moveaxis(self.lagged[..., 0, :, :, :], (-1, -2, -3), (-3, -2, -1))

    @property
    def previous_substates(self) -> jax.Array:
        """Substates of the previous frame, ``[..., K, P, D]``."""
        return jnp.moveaxis(self.lagged[..., 1, :, :, :], (-1, -2, -3), (-3, -2, -1))


def count_partitions(initial: Initial) -> int:
    """Number of partitions, P, of an initial state."""
    if not callable(initial):
        return initial.shape[0]
    return jax.eval_shape(initial, jax.random.key(0)).shape[0]


def start(key: jax.Array, tracker: Factored) -> FactoredState:
    """Draw a tracker's particles from its initial state, with equal weights."""
    initial, num = tracker.initial, tracker.num_particles * tracker.upsampling
    if callable(initial):
        drawn = jax.vmap(initial)(jax.random.split(key, num))
        chex.assert_rank(drawn, 3)
        values = jnp.moveaxis(as_floats(drawn), (0, 1, 2), (2, 1, 0))
    else:
        values = jnp.repeat(initial.T[..., None], num, axis=-1)
    return FactoredState(
        lagged=jnp.stack([values, values]),
        log_weights=jnp.full(values.shape[1:], -math.log(num), values.dtype),
        weighted=jnp.zeros((), bool),
        presence=confidence.at_start(tracker.likelihood, values.shape[1], values.dtype),
        time=jnp.zeros((), jnp.int32),
    )


def keys_of(key: jax.Array, num_partitions: int) -> jax.Array:
    """Derive one key per partition, independent of the number of partitions."""
    return jax.vmap(lambda p: jax.random.fold_in(key, p))(jnp.arange(num_partitions))


def survivors(tracker: Factored, key, state: FactoredState) -> tuple[jax.Array, jax.Array]:
    """Resample M of the K = M * upsampling particles of each partition by their weights.

    Returns:
        Lagged substates ``[2, D, P, M]`` and equal log-weights ``[P, M]``.
    """
    num, factor = tracker.num_particles, tracker.upsampling
    resample_key, offset_key = jax.random.split(key)
    chosen, log_weights = choose(tracker, resample_key, state.log_weights, state.log_weights)
    # Every factor-th of the K slots from a random start, which keeps every scheme unbiased.
    keys = keys_of(offset_key, chosen.shape[0])
    begin = jax.vmap(lambda k: jax.random.randint(k, (), 0, factor))(keys)
    slots = begin[:, None] + factor * jnp.arange(num)
    # The initial set has equal weights: resampling it would only lose particles.
    ancestors = jnp.where(state.weighted, jnp.take_along_axis(chosen, slots, axis=1), slots)
    log_weights = jnp.take_along_axis(log_weights, slots, axis=1) + math.log(factor)
    uniform = jnp.full_like(log_weights, -math.log(num))
    return taken(state.lagged, ancestors), jnp.where(state.weighted, log_weights, uniform)


def choose(tracker: Factored, key, log_weights, log_selection) -> tuple[jax.Array, jax.Array]:
    """Weighted resampling within each partition: ancestors and log-weights ``[P, N]``."""
    weights = (log_weights,) if log_weights is log_selection else (log_weights, log_selection)

    def choose_in_one(key, *weights):
        return resampling.weighted_resample(key, weights[0], weights[-1], tracker.resampling)

    return jax.vmap(choose_in_one)(keys_of(key, log_weights.shape[0]), *weights)


def taken(lagged: jax.Array, ancestors: jax.Array) -> jax.Array:
    """Gather particles ``[..., P, M]`` from ``[..., P, N]`` by ancestors ``[P, M]``."""
    rows = jnp.arange(ancestors.shape[0])[:, None]
    return lagged[..., rows, ancestors]


def upsampled(lagged, log_weights, factor: int) -> tuple[jax.Array, jax.Array]:
    """Repeat every particle ``factor`` times and divide its weight evenly."""
    if factor == 1:
        return lagged, log_weights
    return (
        jnp.repeat(lagged, factor, axis=-1),
        jnp.repeat(log_weights - math.log(factor), factor, axis=-1),
    )


def moved(tracker: Factored, key, lagged: jax.Array) -> jax.Array:
    """Move every particle by the dynamics: ``[2, D, P, N]`` to ``[D, P, N]``."""
    num_partitions, num = lagged.shape[-2:]
    parent = jnp.zeros((lagged.shape[1], num), lagged.dtype)

    def move(key, partition, current, previous):
        numbers = jnp.full((num,), partition, jnp.int32)
        return contract.propagate_all(tracker.dynamics, key, numbers, current, previous, parent)

    keys = keys_of(key, num_partitions)
    everyone = jnp.arange(num_partitions, dtype=jnp.int32)
    new = jax.vmap(move, in_axes=(0, 0, 1, 1), out_axes=1)(keys, everyone, lagged[0], lagged[1])
    return new.astype(lagged.dtype)


def weighed(tracker: Factored, observation, values: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Log-likelihoods ``[P, N]`` of ``[D, P, N]``; NaN and +inf are set to -inf and counted."""
    dimension, num_partitions, num = values.shape
    partition = jnp.repeat(jnp.arange(num_partitions, dtype=jnp.int32), num)
    log_prob = contract.log_prob_all(
        tracker.likelihood, observation, partition, values.reshape(dimension, -1)
    ).astype(values.dtype)
    chex.assert_shape(log_prob, (num_partitions * num,))
    log_prob, num_invalid = sanitised(log_prob)
    return log_prob.reshape(num_partitions, num), num_invalid


def multiplied(log_weights: jax.Array, log_factor: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Multiply weights ``[P, N]`` by a factor and normalise; also return the log totals ``[P]``.

    A partition whose factors are all zero keeps its weights: the frame is skipped for it.
    """
    weighted, totals = logs.multiplied(log_weights, log_factor)
    possible = ~jnp.isneginf(totals)[:, None]
    return jnp.where(possible, weighted, logs.normalised(log_weights)[0]), totals


def seen_near(tracker: Factored, state: FactoredState, observation: Any) -> Any:
    """The observation near the estimates of a state, see ``jaxpf.contract.calls.look_near``."""
    return look_near(
        tracker.likelihood, observation, lambda: means(state.log_weights, state.lagged[0]).T
    )


def means(log_weights: jax.Array, values: jax.Array) -> jax.Array:
    """Weighted means ``[D, P]`` of ``[D, P, N]``; particles of zero weight may hold NaN."""
    return moments(values, jnp.exp(log_weights), _weighted_sum)[0]


def _weighted_sum(values: jax.Array, weights: jax.Array) -> jax.Array:
    return jnp.einsum("dpn,pn->dp", values, weights)


def summarise(state: FactoredState, log_totals, num_invalid, log_evidence=None) -> Summary:
    """Summarise the weighted sets of a frame.

    Args:
        state: the normalised sets.
        log_totals: ``[P]``, log total weight of each set before normalising; -inf for a lost one.
        num_invalid: ``[]`` int32, number of invalid log-likelihoods.
        log_evidence: ``[]``; default the sum of ``log_totals``.
    """
    weights = jnp.exp(state.log_weights)
    estimate, spread = moments(state.lagged[0], weights, _weighted_sum)
    lost = jnp.isneginf(log_totals)
    ess = 1.0 / jnp.where(lost, jnp.inf, jnp.sum(weights**2, axis=1))
    impossible = jnp.any(lost)
    return Summary(
        estimate=estimate.T,
        log_evidence=jnp.sum(log_totals) if log_evidence is None else log_evidence,
        ess=jnp.min(ess),
        distinct_share=jnp.ones_like(ess),  # every particle is a distinct draw
        spread=spread.T,
        status=(
            STATUS_INVALID_LIKELIHOOD * (num_invalid > 0)
            + (STATUS_IMPOSSIBLE + STATUS_WITHOUT_LIKELIHOOD) * impossible
        ).astype(jnp.int32),
        without_likelihood=lost,
        num_invalid=num_invalid,
        ess_parts=ess,
    )
