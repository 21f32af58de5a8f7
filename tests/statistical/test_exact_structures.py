"""Deeper trees, forests, run-time labels and user-written models against the Kalman filter."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from exact import (
    BATCH,
    COMPILER_OPTIONS,
    DEEP_TREE,
    FOREST,
    LIMIT,
    RUNS,
    TREE,
    moments,
    monte_carlo,
    problem,
    scores,
    scores_of,
)

from jaxpf import ordering, pytree_dataclass
from jaxpf.running import runs

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


# Deeper trees and forests.


@pytest.mark.parametrize("swap", ["none", "combinatorial"])
def test_sps_on_a_three_level_tree_is_unbiased(swap):
    exact = problem(DEEP_TREE)
    found = scores(exact, ordering.sps(DEEP_TREE, swap), resampling="multinomial")
    assert found.worst < LIMIT


def forest():
    return problem(FOREST, transition=0.7, lag=0.3, initial_scale=1.0)


@pytest.mark.parametrize("swap", ["none", "combinatorial"])
def test_sps_on_a_forest_without_exchanged_roots_is_unbiased(swap):
    trees = ordering.sps(FOREST, swap, exchange_roots=False)
    assert scores(forest(), trees).worst < LIMIT


def test_exchanged_roots_of_a_forest_cost_less_than_this_test_resolves():
    """The bias is O(1/N): not zero, and below four standard errors of 20 000 runs here."""
    assert scores(forest(), ordering.sps(FOREST)).worst < LIMIT


# Run-time labels.


def _labelled_run(tracker, key, frames, probabilities):
    """``jaxpf.run`` with random labels, which the particles keep."""
    state = runs.init(tracker, key)
    label_key = jax.random.fold_in(key, 12345)
    labels = jax.random.categorical(
        label_key, jnp.log(probabilities), shape=(tracker.num_particles,)
    )
    state = dataclasses.replace(state, component=labels.astype(jnp.int32))
    step = runs.one_run(tracker, key, moments)
    return jax.lax.scan(step, state, (jnp.arange(len(frames)), frames))[1]


@partial(jax.jit, compiler_options=COMPILER_OPTIONS)
def _labelled_runs(tracker, keys, frames, probabilities):
    def one_batch(keys):
        one = jax.vmap(_labelled_run, in_axes=(None, 0, None, None))
        return one(tracker, keys, frames, probabilities)

    recorded = jax.lax.map(one_batch, keys.reshape(-1, BATCH))
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), recorded)


@pytest.mark.parametrize(
    "probabilities",
    [
        pytest.param([0.5, 0.3, 0.2], id="three-branches"),
        pytest.param([0.97, 0.03, 0.0], id="tiny-and-empty-branches"),
        pytest.param([0.0, 0.0, 1.0], id="only-the-last-branch"),
    ],
)
def test_branched_filter_is_unbiased_whatever_the_sizes_of_its_branches(probabilities):
    exact = problem(TREE)
    tracker = exact.tracker(ordering.branched([[0, 1, 2], [0, 2, 1], [0, 2, 1]]))
    keys = jax.random.split(jax.random.key(3), RUNS)
    recorded = _labelled_runs(tracker, keys, exact.frames, jnp.array(probabilities))
    assert scores_of(recorded, exact).worst < LIMIT


# Models written by a user for one particle, that return another dtype.


@pytree_dataclass
class OneParticleMotion:
    """``x = .9 x_ + .5 parent + n``, in float32 whatever it is given."""

    share: jax.Array

    def propagate(self, key, partition, current, previous, parent):
        noise = jax.random.normal(key, current.shape, jnp.float32)
        return (0.9 * current + self.share * parent + noise).astype(jnp.float32)


@pytree_dataclass
class OneParticleLikelihood:
    """``y = x + n``, in float32 whatever it is given."""

    scale: jax.Array

    def observe(self, frame):
        return frame[:, 0]

    def log_prob(self, observation, partition, substate):
        residual = (observation[partition] - substate[0]) / self.scale
        return (-0.5 * residual**2 - 0.5 * jnp.log(2 * jnp.pi)).astype(jnp.float32)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: ordering.ps([0, 2, 1]), id="ps"),
        pytest.param(lambda: ordering.sps(TREE), id="sps-combinatorial"),
    ],
)
def test_models_written_for_one_particle_have_the_law_of_the_built_in_ones(make):
    exact = problem(TREE)._replace(
        dynamics=OneParticleMotion(share=np.float64(0.5)),
        likelihood=OneParticleLikelihood(scale=np.float64(1.0)),
    )
    assert scores(exact, make()).worst < LIMIT


# Components without any likelihood.


@pytree_dataclass
class Beyond:
    """Likelihood one beyond the frame's threshold, zero before it."""

    factor: jax.Array

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        beyond = substate[0] > observation[partition, 0]
        return jnp.where(beyond, jnp.log(self.factor), -jnp.inf)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: ordering.sir(3), id="sir"),
        pytest.param(lambda: ordering.ps([2, 0, 1]), id="ps"),
        pytest.param(lambda: ordering.dps(3), id="dps"),
        pytest.param(lambda: ordering.sps(num_partitions=3), id="sps-combinatorial"),
    ],
)
def test_evidence_is_unbiased_where_whole_components_often_die(make):
    """With 12 particles and a likelihood that 16% survive, most components die out."""
    exact = problem((-1, -1, -1), transition=0.0)._replace(
        likelihood=Beyond(factor=np.float64(2.0)), frames=np.ones((2, 3, 1))
    )
    tracker = exact.tracker(make(), num_particles=12)
    keys = jax.random.split(jax.random.key(5), RUNS)
    log_evidence = np.asarray(
        monte_carlo(tracker, keys, exact.frames, record=_log_evidence, batch_size=BATCH)
    )
    assert np.isneginf(log_evidence).any()
    evidence = np.exp(log_evidence.sum(1))
    survival = 2.0 * scipy.stats.norm.sf(1.0)
    z = (evidence.mean() - survival**6) / (evidence.std() / RUNS**0.5)
    assert abs(z) < LIMIT


def _log_evidence(state, summary):
    return summary.log_evidence
