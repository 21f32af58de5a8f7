"""Deeper trees, forests, run-time labels and user-written models against the Kalman filter."""

import dataclasses

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
from records import only_evidence, z_score

import jaxpf
from jaxpf import ordering, pytree_dataclass

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


@pytest.mark.parametrize("probabilities", [[0.5, 0.3, 0.2], [0.97, 0.03, 0.0], [0.0, 0.0, 1.0]])
def test_branched_filter_is_unbiased_whatever_the_sizes_of_its_branches(probabilities):
    exact = problem(TREE)
    tracker = exact.tracker(ordering.branched([[0, 1, 2], [0, 2, 1], [0, 2, 1]]))

    def labelled_run(key):
        """Particles keep their random labels."""
        state, number = tracker.init(jax.random.fold_in(key, 0)), tracker.num_particles
        labels = jax.random.categorical(
            jax.random.fold_in(key, 12345), jnp.log(jnp.array(probabilities)), shape=(number,)
        )
        state = dataclasses.replace(state, component=labels.astype(jnp.int32))
        return jaxpf.run(tracker, key, exact.frames, moments, state=state)[1]

    many = jax.jit(
        lambda keys: jax.lax.map(labelled_run, keys, batch_size=BATCH),
        compiler_options=COMPILER_OPTIONS,
    )
    recorded = many(jax.random.split(jax.random.key(3), RUNS))
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
    "order", [ordering.ps([0, 2, 1]), ordering.sps(TREE)], ids=["ps", "sps-combinatorial"]
)
def test_models_written_for_one_particle_have_the_law_of_the_built_in_ones(order):
    exact = problem(TREE)._replace(
        dynamics=OneParticleMotion(share=np.float64(0.5)),
        likelihood=OneParticleLikelihood(scale=np.float64(1.0)),
    )
    assert scores(exact, order).worst < LIMIT


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
    "order",
    [ordering.sir(3), ordering.ps([2, 0, 1]), ordering.dps(3), ordering.sps(num_partitions=3)],
    ids=["sir", "ps", "dps", "sps-combinatorial"],
)
def test_evidence_is_unbiased_where_whole_components_often_die(order):
    """With 12 particles and a likelihood that 16% survive, most components die out."""
    exact = problem((-1, -1, -1), transition=0.0)._replace(
        likelihood=Beyond(factor=np.float64(2.0)), frames=np.ones((2, 3, 1))
    )
    tracker = exact.tracker(order, num_particles=12)
    keys = jax.random.split(jax.random.key(5), RUNS)
    log_evidence = np.asarray(
        monte_carlo(tracker, keys, exact.frames, record=only_evidence, batch_size=BATCH)
    )
    assert np.isneginf(log_evidence).any()
    evidence = np.exp(log_evidence.sum(1))
    survival = 2.0 * scipy.stats.norm.sf(1.0)
    assert z_score(evidence, survival**6) < LIMIT
