"""Runs side by side: their mean, its standard error, their evidence, their pooled particles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import InputError, ordering, running
from jaxpf.contract.state import moments
from jaxpf.dynamics import RandomWalk
from jaxpf.filters import SideBySide, quantiles
from jaxpf.likelihoods import Gaussian, kalman

FRAMES = np.array([[[0.5], [1.0]], [[2.0], [0.0]], [[1.0], [-1.0]]], np.float32)
RUNS = 4


def one():
    return jaxpf.Partitioned(
        dynamics=RandomWalk(1.0),
        likelihood=Gaussian(noise=jnp.ones((2, 1, 1))),
        ordering=ordering.ps([0, 1]),
        initial=jnp.zeros((2, 1)),
        num_particles=20,
    )


def test_a_frame_reports_the_pooled_particles_of_all_runs():
    both = SideBySide(one(), RUNS)
    state, summary = jax.jit(both.step)(jax.random.key(1), both.init(jax.random.key(0)), FRAMES[0])
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
    ends = [running.run(its, jax.random.key(3), FRAMES)[0] for its in (fewer, more)]
    kept = [np.asarray(end.log_evidence) for end in ends]
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


def test_quantiles_are_values_that_so_much_weight_reaches():
    values = np.array([3.0, 1.0, 2.0, np.nan])[:, None, None]
    log_weights = np.log([0.2, 0.3, 0.5, 1e-300])
    assert quantiles(values, log_weights, [0.25, 0.5, 0.79, 0.81])[:, 0, 0].tolist() == [1, 2, 2, 3]
    of_each = quantiles(np.tile(values, (1, 2, 1)), np.stack([log_weights] * 2), [0.5])
    assert of_each.tolist() == [[[2.0], [2.0]]]
    # Of particles that hold one target each, by the weight of those that hold it.
    held = np.array([[3.0, np.nan], [1.0, np.nan], [2.0, np.nan], [np.nan, 7.0]])[..., None]
    of_targets = quantiles(held, np.log([0.02, 0.03, 0.05, 0.9]), [0.25, 0.79, 1])[..., 0]
    assert of_targets.tolist() == [[1, 7], [2, 7], [3, 7]]
    assert np.isnan(quantiles(held[:3], np.log([0.2, 0.3, 0.5]), [0.5])[0, 1, 0])


def test_one_run_says_nothing_of_how_much_runs_differ():
    with pytest.raises(InputError, match=r"num_runs=1 .* at least 2"):
        SideBySide(one(), 1)
