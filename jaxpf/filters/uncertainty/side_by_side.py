"""Parallel runs of one filter: their mean and its standard error.

Runs share each frame's observation and differ only in their random numbers, so ten runs cost a few
times as much as one.  Their results differ only by the Monte Carlo error: the standard deviation of
R estimates over sqrt(R) is the standard error of their mean.
"""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.logs import multiplied
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import compiled_alone, pytree_dataclass, static_field
from jaxpf.contract.state import Summary, power_of_two, root_or_zero
from jaxpf.filters.uncertainty.error_bars import ErrorBars


@pytree_dataclass
class RunsState:
    """The states of R runs, and their particles pooled.

    Attributes:
        runs: the filter's states, with a leading axis R.
        log_shares: ``[R]``, log of each run's share of the evidence of all frames processed; -inf
            for a run with an impossible frame.
    """

    runs: Any
    log_shares: jax.Array

    @property
    def time(self) -> jax.Array:
        """Number of frames processed, ``[]`` int32."""
        return self.runs.time[..., 0]

    @property
    def substates(self) -> jax.Array:
        """Particles of all runs, ``[R N, P, D]``."""
        return jnp.concatenate(list(self.runs.substates))

    @property
    def log_weights(self) -> jax.Array:
        """Log-weights of all runs, ``[R N]``, or ``[P, R K]`` if partitions have own weights."""
        weights = self.runs.log_weights
        return jnp.concatenate(list(weights), axis=-1) - np.log(len(weights)).astype(weights.dtype)

    @property
    def label(self) -> jax.Array | None:
        """Labels of all runs, ``[R N]``; None if particles carry no labels."""
        label = getattr(self.runs, "label", None)
        return None if label is None else label.reshape(-1)


@pytree_dataclass
class SideBySide(contract.WrappedTracker):
    """R runs of a tracker as one tracker, whose estimate is their mean.

    Run r uses the frame's key folded with r, so adding runs does not change the others, up to
    rounding.  A frame reports ``ErrorBars`` of the pooled particles.  ``estimate`` is the mean over
    runs and ``estimate_variance`` the variance of this mean: a quarter for four times as many runs.
    ``log_evidence`` sums over frames to the log of the runs' mean evidence, which is unbiased if
    each run's evidence is (``contract.evidence_biases``); ``evidence_variance`` is NaN if it is
    grossly biased.  A run with an impossible frame counts as zero from then on.

    Attributes:
        tracker: a tracker that reports a ``jaxpf.Summary``.
        num_runs: static, R.

    Raises:
        InputError: fewer than two runs.
    """

    tracker: Any
    num_runs: int = static_field(default=2)

    def __post_init__(self):
        check_whole("num_runs", self.num_runs, 2)  # one run does not show how much runs differ

    @property
    def num_particles(self) -> int:
        """Number of particles of all runs."""
        return self.tracker.num_particles * self.num_runs

    @compiled_alone
    def init(self, key: jax.Array) -> RunsState:
        """Return the runs' initial states."""
        runs = jax.vmap(self.tracker.init)(self._keys(key))
        dtype = jax.tree.leaves(getattr(runs, "log_weights", jnp.zeros(())))[0].dtype
        return RunsState(runs, self._equal_shares(dtype))

    def step_observed(
        self, key: jax.Array, state: RunsState, observation: Any
    ) -> tuple[RunsState, ErrorBars]:
        """Advance every run by one frame."""
        step = calls.observed_apart(self.tracker)[1]
        runs, summaries = jax.vmap(lambda key, run: step(key, run, observation))(
            self._keys(key), state.runs
        )
        # Once all runs have zero evidence, start again: later increments stay defined.
        shares = state.log_shares
        all_dead = jnp.all(jnp.isneginf(shares))
        shares = jnp.where(all_dead, self._equal_shares(shares.dtype), shares)
        shares, increment = multiplied(shares, summaries.log_evidence)
        pooled = _pooled(summaries, increment, shares)
        for bias in contract.evidence_biases(self.tracker):
            if bias.gross and pooled.evidence_variance is not None:
                variance = jnp.where(bias.applies, jnp.nan, pooled.evidence_variance)
                pooled = dataclasses.replace(pooled, evidence_variance=variance)
        return RunsState(runs, shares), pooled

    def _equal_shares(self, dtype: DTypeLike) -> jax.Array:
        return jnp.full(self.num_runs, -np.log(self.num_runs), dtype)

    def _keys(self, key: jax.Array) -> jax.Array:
        return jax.vmap(functools.partial(jax.random.fold_in, key))(jnp.arange(self.num_runs))


def _relative_variance(log_shares: jax.Array) -> jax.Array:
    """Relative variance ``[]`` of the runs' mean evidence, given shares ``[R]``; NaN if it is 0."""
    num_runs, dead = len(log_shares), jnp.all(jnp.isneginf(log_shares))
    return jnp.where(dead, jnp.nan, jnp.var(num_runs * jnp.exp(log_shares)) / (num_runs - 1))


def _pooled(runs: Summary, log_evidence: jax.Array, log_shares: jax.Array) -> ErrorBars:
    """Combine the summaries ``[R, ...]`` of R runs."""

    def mean(values: Any) -> Any:
        return jax.tree.map(lambda x: jnp.mean(x, axis=0), values)

    def pooled_size(sizes: Any) -> Any:
        return None if sizes is None else len(sizes) ** 2 / jnp.sum(1 / sizes, axis=0)

    def pooled_spread(spread: jax.Array, estimate: jax.Array) -> jax.Array:
        apart = jnp.abs(estimate - estimate[0])
        unit = power_of_two(jnp.max(jnp.maximum(spread, apart), axis=0))
        variance = jnp.mean((spread / unit) ** 2, axis=0) + jnp.var(estimate / unit, axis=0)
        return unit * root_or_zero(variance)

    num_runs = len(runs.ess)
    between = jax.tree.map(lambda x: jnp.var(x, axis=0), runs.estimate)
    return ErrorBars(
        estimate=mean(runs.estimate),
        log_evidence=log_evidence,
        ess=pooled_size(runs.ess),
        distinct_share=mean(runs.distinct_share),
        spread=jax.tree.map(pooled_spread, runs.spread, runs.estimate),
        status=jnp.bitwise_or.reduce(runs.status),
        without_likelihood=jnp.all(runs.without_likelihood, axis=0),
        num_invalid=jnp.sum(runs.num_invalid),
        ess_parts=pooled_size(runs.ess_parts),
        label_probabilities=mean(runs.label_probabilities),
        confidence=mean(runs.confidence),
        estimate_variance=jax.tree.map(lambda x: x / (num_runs - 1), between),
        evidence_variance=_relative_variance(log_shares),
    )
