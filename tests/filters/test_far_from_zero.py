"""Means and standard deviations of states far from zero, beside which their spread is small."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import norm

import jaxpf

#: Steps of the motion, in which float32 still has twenty values between 1e5 - 1 and 1e5 + 1.
SCALE, OFFSET = 0.05, 1e5
KEY = jax.random.key(0)
FRAMES = np.float32(OFFSET + SCALE * np.random.default_rng(0).normal(size=(20, 2)).cumsum(0).sum(1))


@pytest.fixture(scope="module")
def walk():
    return jaxpf.state_space(
        initial=jnp.float32(OFFSET),
        transition=lambda key, x, p: x + p * jax.random.normal(key),
        transition_log_density=lambda new, x, p: norm.logpdf(new, x, p),
        log_likelihood=lambda y, x, p: norm.logpdf(y, x, p),
        parameters=SCALE,
        num_particles=1000,
    )


def assert_moments(estimate, spread, values, weights):
    """Those of the particles in float64, to a step of float32 and a thousandth."""
    values, weights = np.asarray(values, float), np.asarray(weights, float)
    weights /= weights.sum(axis=-1, keepdims=True)
    mean = np.sum(weights * values, axis=-1)
    deviation = np.sqrt(np.sum(weights * (values - mean[:, None]) ** 2, axis=-1))
    assert np.abs(np.asarray(estimate, float) - mean).max() <= np.spacing(np.float32(OFFSET))
    np.testing.assert_allclose(spread, deviation, rtol=1e-3)


def test_summaries_of_a_filter(walk):
    _, (values, log_weights, summary) = jaxpf.run(
        walk, KEY, FRAMES, record=lambda state, seen: (state.substates, state.log_weights, seen)
    )
    moments = summary.estimate[:, 0, 0], summary.spread[:, 0, 0]
    assert_moments(*moments, values[:, :, 0, 0], np.exp(np.asarray(log_weights, float)))


def test_summaries_of_a_smoother(walk):
    smoothed = jaxpf.smooth(walk, KEY, FRAMES, paths=1000)
    paths = smoothed.paths[:, :, 0, 0].T
    moments = smoothed.estimate[:, 0, 0], smoothed.spread[:, 0, 0]
    assert_moments(*moments, paths, np.ones(paths.shape))
