"""Runs side by side: their mean, its standard error, their evidence, their pooled particles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import partitioned
from records import everything, only_evidence

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.contract.state import moments
from jaxpf.filters import SideBySide
from jaxpf.likelihoods import kalman
from jaxpf.running.runs import frame_key

FRAMES = np.array([[[0.5], [1.0]], [[2.0], [0.0]], [[1.0], [-1.0]]], np.float32)
RUNS = 4


def one():
    return partitioned(ordering.ps([0, 1]), num_particles=20)


@pytest.fixture(scope="module")
def ran():
    """States and summaries of all frames."""
    its = SideBySide(one(), RUNS)
    return jaxpf.run(its, jax.random.key(3), FRAMES, everything)[1]


@pytest.mark.slow
def test_a_frame_reports_the_pooled_particles_of_all_runs(ran):
    state, summary = jax.tree.map(lambda x: x[0], ran)
    weights = jnp.exp(state.log_weights)
    assert state.substates.shape == (RUNS * 20, 2, 1)
    np.testing.assert_allclose(weights.sum(), 1, rtol=1e-5)
    mean, spread = moments(jnp.moveaxis(state.substates, 0, -1), weights, jnp.matmul)
    np.testing.assert_allclose(summary.estimate, mean, rtol=1e-4)
    np.testing.assert_allclose(summary.spread, spread, rtol=1e-4)
    np.testing.assert_allclose(summary.ess, 1 / (weights @ weights), rtol=1e-4)
    estimates = jax.vmap(lambda run: moments(run.lagged[0], jnp.exp(run.log_weights), jnp.matmul))(
        state.runs
    )[0]
    expected = np.var(np.asarray(estimates), axis=0, ddof=1).T / RUNS
    np.testing.assert_allclose(summary.estimate_variance, expected, rtol=1e-3)


@pytest.mark.slow
def test_each_run_is_its_own_and_stays_when_others_join_it():
    fewer, more = (SideBySide(one(), number) for number in (2, RUNS))
    ends = [jaxpf.run(its, jax.random.key(3), FRAMES)[0] for its in (fewer, more)]
    kept = [np.asarray(end.log_shares - end.log_shares[0]) for end in ends]
    np.testing.assert_allclose(kept[0], kept[1][:2], rtol=1e-5)
    assert len(set(kept[1].tolist())) == RUNS


@pytest.mark.slow
@pytest.mark.statistical
def test_the_errors_are_those_of_many_and_the_evidence_is_without_bias():
    keys, both = jax.random.split(jax.random.key(0), 500), SideBySide(one(), RUNS)
    found = jaxpf.monte_carlo(both, keys, FRAMES)
    true = np.var(np.asarray(found.estimate), axis=0, ddof=1)
    told = np.asarray(found.estimate_variance)
    # A variance from 500 is right to .063; one from 4, of which 500 are averaged, to .037.
    assert np.all(np.abs(told.mean(axis=0) / true - 1) < 4.5 * np.hypot(0.063, 0.037))
    evidence = np.exp(np.asarray(found.log_evidence, np.float64).sum(axis=1))
    eye = np.eye(2)
    exact = np.exp(kalman(eye, eye, eye, eye, np.zeros(2), 0 * eye, FRAMES[..., 0])[0].sum())
    error = evidence.std(ddof=1) / np.sqrt(len(evidence))
    assert abs(evidence.mean() - exact) < 4.5 * error


@pytest.mark.slow
@pytest.mark.always
def test_the_evidence_is_the_mean_of_the_runs_products(ran):
    both, key, (states, summaries) = SideBySide(one(), RUNS), jax.random.key(3), ran

    def alone(number):
        def step(state, item):
            time, frame = item
            own = jax.random.fold_in(frame_key(key, time), number)
            state, summary = both.tracker.step(own, state, frame)
            return state, summary.log_evidence

        first = both.tracker.init(jax.random.fold_in(jax.random.fold_in(key, 0), number))
        return jnp.sum(jax.lax.scan(step, first, (jnp.arange(len(FRAMES)), FRAMES))[1])

    log_evidence = jax.jit(jax.vmap(alone))(jnp.arange(RUNS))
    shares = jax.nn.log_softmax(log_evidence)
    np.testing.assert_allclose(states.log_shares[-1], shares, rtol=1e-4)
    expected = np.log(np.mean(np.exp(np.asarray(log_evidence, float))))
    np.testing.assert_allclose(np.sum(summaries.log_evidence), expected, rtol=1e-5)


@pytree_dataclass
class Anywhere:
    """A place that is standard normal, whatever was before."""

    def propagate(self, key, partition, current, previous, parent):
        return jax.random.normal(key, current.shape)


@pytree_dataclass
class InBox:
    """Possible within .2225 of the middle alone, so with probability .1761."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return jnp.where(jnp.abs(substate[0] - observation) < 0.2225, 0.0, -jnp.inf)


LONE = partitioned(ordering.sir(1), dynamics=Anywhere(), likelihood=InBox(), num_particles=6)


@pytest.mark.statistical
@pytest.mark.parametrize("num_runs", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_a_run_that_met_an_impossible_frame_counts_as_zero(num_runs):
    """Of six particles none is possible in every third frame."""
    its = LONE if num_runs == 1 else SideBySide(LONE, num_runs)
    keys, frames = jax.random.split(jax.random.key(0), 20_000), np.zeros(3, np.float32)
    found = jaxpf.monte_carlo(its, keys, frames, only_evidence, batch_size=2000)
    evidence = np.exp(np.asarray(found, float).sum(axis=1)) / 0.17607**3
    assert np.isfinite(evidence).all()
    assert abs(evidence.mean() - 1) < 4.5 * evidence.std() / np.sqrt(len(evidence))


def test_a_frame_is_counted_anew_when_all_runs_are_dead():
    frames = np.array([0.0, 50.0, 0.0], np.float32)
    state, summary = jaxpf.run(SideBySide(LONE, 8), jax.random.key(0), frames)
    increments = np.asarray(summary.log_evidence)
    assert np.isfinite(increments[[0, 2]]).all()
    assert np.isneginf(increments[1])
    assert np.isnan(summary.evidence_variance[1])
    possible = np.sum(np.isfinite(state.runs.log_weights), axis=1) / 6
    mean = np.mean(np.where(np.isfinite(state.log_shares), possible, 0.0))
    np.testing.assert_allclose(increments[2], np.log(mean), rtol=1e-5)


@pytree_dataclass
class OnlyEvidence(jaxpf.contract.Tracker):
    """Whose state is the frame's log evidence, and its estimate too."""

    num_particles = num_partitions = 1

    def init(self, key):
        return jnp.zeros(())

    def observe(self, frame):
        return frame

    def step_observed(self, key, state, observation):
        value = observation + jax.random.normal(key)
        one, part = jnp.ones(()), jnp.ones((1, 1))
        zero = jnp.zeros((), jnp.int32)
        return value, jaxpf.Summary(
            value * part, value, one, one[None], part, zero, zero[None] > 0, zero
        )


def test_variances_are_those_of_the_mean_of_so_few_runs():
    """Of three: by dividing by 3 instead of 2 they would be a third too small."""
    of_runs, summary = jaxpf.run(
        SideBySide(OnlyEvidence(), 3),
        jax.random.key(0),
        np.float32([0.5, -1.0, 2.0, 0.0]),
        lambda state, summary: (state.runs, summary),
    )[1]
    of_runs = np.asarray(of_runs, float)
    expected = of_runs.var(axis=1, ddof=1) / 3
    np.testing.assert_allclose(summary.estimate_variance[:, 0, 0], expected, rtol=1e-4)
    evidence = np.exp(np.cumsum(of_runs, axis=0))
    relative = evidence / evidence.mean(axis=1, keepdims=True)
    expected = relative.var(axis=1, ddof=1) / 3
    np.testing.assert_allclose(summary.evidence_variance, expected, rtol=1e-4)


def test_increments_of_long_runs_do_not_drift():
    """Differences of sums would be wrong by more than 100."""
    frames = np.full(100_000, -50.0, np.float32)
    of_runs, increments = jaxpf.run(
        SideBySide(OnlyEvidence(), RUNS),
        jax.random.key(0),
        frames,
        lambda state, summary: (state.runs, summary.log_evidence),
    )[1]
    of_runs = np.sum(np.asarray(of_runs, float), axis=0)
    expected = np.logaddexp.reduce(of_runs) - np.log(RUNS)
    assert abs(jaxpf.log_evidence(increments) - expected) < 0.05
