"""Means and standard deviations of states far from zero, beside which their spread is small."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import log_density, space

import jaxpf

#: Steps of the motion, in which float32 still has twenty values between 1e5 - 1 and 1e5 + 1.
SCALE, OFFSET = 0.05, 1e5
KEY = jax.random.key(0)
FRAMES = np.float32(OFFSET + SCALE * np.random.default_rng(0).normal(size=(20, 2)).cumsum(0).sum(1))


WALK = space(
    initial=jnp.float32(OFFSET),
    transition_log_density=log_density,
    parameters={"a": 1.0, "s": SCALE, "noise": SCALE},
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


def test_summaries_of_a_filter():
    _, (values, log_weights, summary) = jaxpf.run(
        WALK, KEY, FRAMES, record=lambda state, seen: (state.substates, state.log_weights, seen)
    )
    moments = summary.estimate[:, 0, 0], summary.spread[:, 0, 0]
    assert_moments(*moments, values[:, :, 0, 0], np.exp(np.asarray(log_weights, float)))


@pytest.mark.slow
@pytest.mark.always
def test_summaries_of_a_smoother():
    smoothed = jaxpf.smooth(WALK, KEY, FRAMES, paths=1000)
    paths = smoothed.paths[:, :, 0, 0].T
    moments = smoothed.estimate[:, 0, 0], smoothed.spread[:, 0, 0]
    assert_moments(*moments, paths, np.ones(paths.shape))


@pytest.mark.parametrize("runs", [1, 2])
def test_spreads_whose_squares_leave_float32(runs):
    """A model in other units, powers of two near 1e-20 and 1e20, has the same spread in them."""

    def of_unit(unit):
        its = jaxpf.state_space(
            initial=jnp.float32(0),
            transition=lambda key, x, p: x + p * jax.random.normal(key),
            log_likelihood=lambda y, x, p: -0.5 * (y - x / p) ** 2,
            parameters=unit,
            num_particles=50,
        )
        if runs > 1:
            its = jaxpf.filters.SideBySide(its, runs)
        return jaxpf.run(its, KEY, jnp.arange(3.0))[1].spread / unit

    found = jax.jit(lambda units: jax.lax.map(of_unit, units))(2.0 ** jnp.array([0, -67, 67]))
    assert (found[0] > 0.1).all()
    np.testing.assert_array_equal(found, np.broadcast_to(found[:1], found.shape))
