"""A constant in the log-likelihood changes no posterior of parameters, in float32 to the last bit.

A filter of one particle estimates the evidence by a product of likelihoods.  Their logarithms are
whole sixteenths, which float32 holds beside a constant of -1e6, but beside no sum of several.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import tuning
from jaxpf.lowering.derivatives import with_gradient_of

KEY, T = jax.random.key(1), 12
FRAMES = 0.5 + np.random.default_rng(0).normal(size=T).astype(np.float32)


def log_likelihood(y, x, p):
    value = -0.5 * (y["y"] - x - p["mean"]) ** 2
    sixteenths = jnp.round(16 * jax.lax.stop_gradient(value)) / 16
    return with_gradient_of(sixteenths, value) + y["constant"]


def build(p):
    return jaxpf.state_space(
        initial=0.0,
        transition=lambda key, x, p: 0.5 * jax.random.normal(key),
        log_likelihood=log_likelihood,
        parameters=p,
        num_particles=1,
    )


def log_prior(p):
    return -0.5 * p["mean"] ** 2


def draw_prior(key):
    return {"mean": jax.random.normal(key)}


def by_smc2(frames):
    found = tuning.smc2(build, log_prior, draw_prior, KEY, frames, num_draws=32, num_particles=1)
    assert np.nanmax(found.acceptance) > 0.1
    return found.parameters, found.log_weights, found.mean, found.spread


def by_pmmh(frames):
    few = {"num_draws": 60, "num_warmup": 20, "num_chains": 2, "num_particles": 1}
    found = jaxpf.pmmh(build, log_prior, KEY, frames, {"mean": 0.0}, **few)
    assert np.mean(found.accepted) > 0.05
    return found.parameters


@jax.jit
def by_slope(frames):
    keys = jax.random.split(KEY, 8)
    return jax.grad(lambda p: jnp.mean(tuning.log_evidence(build(p), keys, frames)))({"mean": 0.0})


@pytest.mark.parametrize("job", [by_smc2, by_pmmh, by_slope])
def test_a_constant_changes_no_posterior(job):
    found, expected = (
        job({"y": FRAMES, "constant": np.full(T, constant, np.float32)}) for constant in (-1e6, 0.0)
    )
    jax.tree.map(np.testing.assert_array_equal, found, expected)
