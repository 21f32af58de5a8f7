"""Logarithms of weights and evidence keep their digits beside a large constant."""

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.contract import logs

INCREMENTS = -50 + np.random.default_rng(0).normal(size=(2, 200_000)).astype(np.float32)


def test_weights_sum_to_one_whatever_they_are_multiplied_by():
    values = np.float32([np.log(0.1), -np.inf, np.log(0.3)])
    for constant in (0, -3e6, 1e30):
        found, total = logs.normalised(values + np.float32(constant))
        np.testing.assert_allclose(np.exp(found).sum(), 1, rtol=1e-6)
        np.testing.assert_allclose(total, np.log(0.4) + constant, rtol=1e-6)


def test_weights_that_are_all_zero_stay_zero_and_have_a_derivative():
    nothing = jnp.full(3, -jnp.inf)
    found, total = logs.normalised(nothing)
    assert np.isneginf(found).all()
    assert np.isneginf(total)
    assert not jax.grad(lambda x: logs.normalised(x)[1])(nothing).any()


def test_a_particle_without_weight_takes_no_part():
    """Its factor is not the largest that is taken out, beside which the others would be equal."""
    log_weights = jnp.log(jnp.array([0.5, 0.5, 0.0], jnp.float32))
    found, total = logs.multiplied(log_weights, jnp.array([0.0, 1.0, 1e8], jnp.float32))
    mean = (1 + np.e) / 2
    np.testing.assert_allclose(np.exp(found), [0.5 / mean, 0.5 * np.e / mean, 0], rtol=1e-6)
    np.testing.assert_allclose(total, np.log(mean), rtol=1e-6)


def test_a_factor_of_zero_leaves_nothing():
    found, total = logs.multiplied(jnp.log(jnp.full(3, 1 / 3)), jnp.full(3, -jnp.inf))
    assert np.isneginf(found).all()
    assert np.isneginf(total)


def test_a_sum_keeps_what_rounding_loses():
    total = jax.jit(lambda values: jax.lax.scan(add, jnp.zeros(2), values)[0])
    found = np.asarray(total(np.float32([1e7, 0.25, -3, 2**30, 0.125, -(2**30), -1e7])), float)
    assert found.sum() == 0.25 - 3 + 0.125


def add(total, value):
    return logs.add_exactly(total, value), None


def test_log_evidence_of_long_runs_does_not_drift():
    exact = INCREMENTS.astype(float).sum(axis=1)
    found = jaxpf.log_evidence(INCREMENTS)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, exact)
    running = jax.lax.scan(lambda total, x: (total + x, None), jnp.zeros(2), INCREMENTS.T)[0]
    traced = jax.jit(lambda x: jaxpf.log_evidence(x, axis=0))(INCREMENTS.T)
    assert np.abs(running - exact).min() > 10
    assert np.abs(traced - exact).max() <= 2  # 1e7 has steps of 1
    odd = jnp.arange(7.0)
    np.testing.assert_array_equal(jax.grad(lambda x: jaxpf.log_evidence(x))(odd), 1)
