"""Smoothing and particle Gibbs against closed forms, where weights, inputs and gaps all count.

The smallest errors that were planted and found: weights, or a likelihood of the previous state, to
the power .95; for particle Gibbs the last frame's weights alone, or a frame too early.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import COMPILER_OPTIONS
from jax.scipy.stats import norm
from pushed import FRAMES, FRAMES_OF_BOTH, INPUTS, LAG, exact, model, z_scores

import jaxpf

pytestmark = pytest.mark.statistical

KEY = jax.random.key(5)
LIMIT = 4.5


def many(function, keys, *rest):
    """``function`` of many keys, compiled with little optimisation."""
    mapped = jax.vmap(function)
    return jax.jit(mapped, compiler_options=COMPILER_OPTIONS)(keys, *rest)


@pytest.mark.parametrize("method", ["backward", "metropolis", "genealogy"])
def test_smoothing_of_a_likelihood_of_two_states_is_exact(method):
    """Times the evidence, moments are unbiased at any number of particles."""
    mean, covariance, log_evidence = exact(1.0, lag=LAG, frames=FRAMES_OF_BOTH)
    mean, second = mean[2:], mean[2:] ** 2 + np.diag(covariance)[2:]
    its = model(looks_back=True, num_particles=30)
    steps = {"num_steps": 1} if method == "metropolis" else {}

    def one(key):
        found = jaxpf.smooth(its, key, FRAMES_OF_BOTH, method=method, inputs=INPUTS, **steps)
        x, spread = found.estimate[:, 0, 0], found.spread[:, 0, 0]
        ratio = jnp.exp(jnp.sum(found.summaries.log_evidence) - log_evidence)
        return ratio, ratio * jnp.stack([x - mean, x**2 + spread**2 - second])

    ratio, off = many(one, jax.random.split(KEY, 12_000))
    assert z_scores(ratio, 1) < LIMIT
    assert z_scores(off, 0).max() < LIMIT


def test_a_conditional_sweep_knows_the_time():
    """Trajectories drawn from the posterior stay draws of it."""
    mean, covariance, _ = exact(1.0)
    runs = 60_000
    rng = np.random.default_rng(0)
    references = rng.multivariate_normal(mean[1:], covariance[1:, 1:], runs)[..., None, None]
    its = model(num_particles=6)

    def one(key, reference):
        sweeps = jaxpf.smoothing.particle_gibbs(its, key, FRAMES, 1, reference, inputs=INPUTS)
        return sweeps[0, :, 0, 0]

    swept = many(one, jax.random.split(KEY, runs), references.astype(np.float32))
    assert np.mean(swept != references[..., 0, 0].astype(np.float32)) > 0.5

    def moments(x):
        return np.concatenate([x, x**2, x[:, 1:] * x[:, :-1]], axis=1)

    change = moments(np.asarray(swept, float)) - moments(references[..., 0, 0])
    assert z_scores(change, 0).max() < LIMIT


def test_the_genealogy_counts_the_ancestors_of_particles_with_weight():
    """Particles without weight, here those below 0, are no one's descendants that count."""
    its = jaxpf.state_space(
        initial=lambda key, p: jax.random.normal(key),
        transition=lambda key, x, p: x + jax.random.normal(key),
        log_likelihood=lambda y, x, p: jnp.where(x > 0, norm.logpdf(y, x), -jnp.inf),
        num_particles=30,
        keep_ancestors=True,
    )
    frames = np.array([0.5, 1.0, 0.3, 0.8], np.float32)
    found = jaxpf.smooth(its, KEY, frames, method="genealogy")
    sources, log_weights = jaxpf.run(
        its, KEY, frames, lambda state, _: (state.sources[0], state.log_weights)
    )[1]
    particles, counts = np.flatnonzero(np.exp(log_weights[-1]) > 0), []
    assert len(particles) < 30
    for time in reversed(range(len(frames))):
        counts.append(len(set(particles.tolist())))
        particles = np.asarray(sources[time])[particles]
    np.testing.assert_array_equal(found.num_ancestors[:, 0], counts[::-1])
    assert len(set(counts)) == len(frames)
