"""Weighted sets of particles, one per partition: what both factored filters share.

Values are ``[D, P, K]`` and weights ``[P, K]``, with particles on the last axis.  Each partition
has its own random keys, so partitions do not affect each other.
"""

import math
from typing import Any

import chex
import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract import logs
from jaxpf.contract.calls import check_factors, look_near
from jaxpf.contract.options import check_fields
from jaxpf.contract.pytree import compiled_alone, pytree_dataclass, static_field
from jaxpf.contract.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_WITHOUT_LIKELIHOOD,
    Presence,
    Summary,
    moments,
    sanitised,
)
from jaxpf.filters import confidence, options as of
from jaxpf.filters.initial import check_rows, count_partitions, draw_initial, initial_rows
from jaxpf.lowering.threefry import with_written_out_key
from jaxpf.resampling import weighted as resampling
from jaxpf.resampling.schemes import scheme_of


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


@pytree_dataclass
class Factored(contract.Tracker):
    """What the factored filters share: their model and the operations on their weighted sets.

    Attributes:
        dynamics: see ``jaxpf.contract.Dynamics``; there are no parents.
        likelihood: see ``jaxpf.contract.Likelihood``; must factor over partitions.
        initial: ``[P, D]``, or a sampler ``key -> [P, D]``, just before the first frame.
        resampling: a name in ``jaxpf.resampling.SCHEMES``, or a custom scheme, see there.
        num_particles: static, M per partition.
        upsampling: static, number of moves per particle; the next frame thins the set to M.
    """

    dynamics: Any
    likelihood: Any
    initial: Any
    resampling: Any = "systematic"
    num_particles: of.NumParticles = static_field(default=50)
    upsampling: of.Upsampling = static_field(default=1)

    def __post_init__(self):
        object.__setattr__(self, "initial", initial_rows(self.initial))
        object.__setattr__(self, "resampling", scheme_of(self.resampling))
        check_fields(self)
        check_factors(self.dynamics, self.likelihood, "factored particles")
        check_rows(self.dynamics, self.num_partitions)

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return count_partitions(self.initial)

    @compiled_alone
    @with_written_out_key
    def init(self, key: jax.Array) -> FactoredState:
        """Draw the state just before the first frame, with equal weights."""
        values = draw_initial(self.initial, key, self.num_particles * self.upsampling)
        return FactoredState(
            lagged=jnp.stack([values, values]),
            log_weights=jnp.full(values.shape[1:], -math.log(values.shape[2]), values.dtype),
            weighted=jnp.zeros((), bool),
            presence=confidence.at_start(self.likelihood, values.shape[1], values.dtype),
            time=jnp.zeros((), jnp.int32),
        )

    def observe(self, frame: Any) -> Any:
        """Do the work that depends on the frame alone."""
        return self.likelihood.observe(frame)

    def looking_near(self, state: FactoredState, observation: Any) -> Any:
        """The observation near a state's estimates, see ``jaxpf.contract.calls.look_near``."""
        chex.assert_shape(state.log_weights, (None, self.num_particles * self.upsampling))
        return look_near(
            self.likelihood, observation, lambda: means(state.log_weights, state.lagged[0]).T
        )

    def survivors(self, key, state: FactoredState) -> tuple[jax.Array, jax.Array]:
        """Resample M of the K = M * upsampling particles of each partition by their weights.

        Returns:
            Lagged substates ``[2, D, P, M]`` and equal log-weights ``[P, M]``.
        """
        num, factor = self.num_particles, self.upsampling
        resample_key, offset_key = jax.random.split(key)
        chosen, log_weights = self.choose(resample_key, state.log_weights, state.log_weights)
        # Every factor-th of the K slots from a random start, which keeps every scheme unbiased.
        keys = keys_of(offset_key, chosen.shape[0])
        begin = jax.vmap(lambda k: jax.random.randint(k, (), 0, factor))(keys)
        slots = begin[:, None] + factor * jnp.arange(num)
        # The initial set has equal weights: resampling it would only lose particles.
        ancestors = jnp.where(state.weighted, jnp.take_along_axis(chosen, slots, axis=1), slots)
        log_weights = jnp.take_along_axis(log_weights, slots, axis=1) + math.log(factor)
        uniform = jnp.full_like(log_weights, -math.log(num))
        return of_ancestors(state.lagged, ancestors), jnp.where(
            state.weighted, log_weights, uniform
        )

    def choose(self, key, log_weights, log_selection) -> tuple[jax.Array, jax.Array]:
        """Weighted resampling within each partition: ancestors and log-weights ``[P, N]``."""
        weights = (log_weights,) if log_weights is log_selection else (log_weights, log_selection)

        def choose_in_one(key, *weights):
            return resampling.weighted_resample(key, weights[0], weights[-1], self.resampling)

        return jax.vmap(choose_in_one)(keys_of(key, log_weights.shape[0]), *weights)

    def upsampled(self, lagged, log_weights) -> tuple[jax.Array, jax.Array]:
        """Repeat every particle ``upsampling`` times and divide its weight evenly."""
        factor = self.upsampling
        if factor == 1:
            return lagged, log_weights
        return (
            jnp.repeat(lagged, factor, axis=-1),
            jnp.repeat(log_weights - math.log(factor), factor, axis=-1),
        )

    def moved(self, key, lagged: jax.Array) -> jax.Array:
        """Move every particle by the dynamics: ``[2, D, P, N]`` to ``[D, P, N]``."""
        num_partitions, num = lagged.shape[-2:]
        parent = jnp.zeros((lagged.shape[1], num), lagged.dtype)

        def move(key, partition, current, previous):
            numbers = jnp.full((num,), partition, jnp.int32)
            return contract.propagate_all(self.dynamics, key, numbers, current, previous, parent)

        keys = keys_of(key, num_partitions)
        everyone = jnp.arange(num_partitions, dtype=jnp.int32)
        new = jax.vmap(move, in_axes=(0, 0, 1, 1), out_axes=1)(keys, everyone, lagged[0], lagged[1])
        return new.astype(lagged.dtype)

    def weighed(self, observation, values: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Log-likelihoods ``[P, N]`` of ``[D, P, N]``; NaN and +inf are set to -inf and counted."""
        dimension, num_partitions, num = values.shape
        partition = jnp.repeat(jnp.arange(num_partitions, dtype=jnp.int32), num)
        log_prob = contract.log_prob_all(
            self.likelihood, observation, partition, values.reshape(dimension, -1)
        ).astype(values.dtype)
        chex.assert_shape(log_prob, (num_partitions * num,))
        log_prob, num_invalid = sanitised(log_prob)
        return log_prob.reshape(num_partitions, num), num_invalid


def keys_of(key: jax.Array, num_partitions: int) -> jax.Array:
    """Derive one key per partition, independent of the number of partitions."""
    return jax.vmap(lambda p: jax.random.fold_in(key, p))(jnp.arange(num_partitions))


def of_ancestors(lagged: jax.Array, ancestors: jax.Array) -> jax.Array:
    """Gather particles ``[..., P, M]`` from ``[..., P, N]`` by ancestors ``[P, M]``."""
    rows = jnp.arange(ancestors.shape[0])[:, None]
    return lagged[..., rows, ancestors]


def multiplied(log_weights: jax.Array, log_factor: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Multiply weights ``[P, N]`` by a factor and normalise; also return the log totals ``[P]``.

    A partition whose factors are all zero keeps its weights: the frame is skipped for it.
    """
    weighted, totals = logs.multiplied(log_weights, log_factor)
    possible = ~jnp.isneginf(totals)[:, None]
    return jnp.where(possible, weighted, logs.normalised(log_weights)[0]), totals


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
