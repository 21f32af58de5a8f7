"""Simulation-based calibration: of truths drawn from the model, ranks among particles are uniform.

A rank is the weight of the particles below the truth (Talts et al. 2018), of every frame's last
partition; with N particles it is uniform but for terms of 1 / N, far below what the test sees.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import jaxpf
from jaxpf import ordering
from jaxpf.dynamics import IndependentGaussian, LinearGaussian
from jaxpf.likelihoods import Gaussian

pytestmark = pytest.mark.statistical

RUNS, FRAMES, PARTS, BINS = 2000, 4, 3, 20
TRANSITION, NOISE = 0.9, 0.7


def drawn():
    """Truths ``[R, T, P]`` and frames ``[R, T, P, 1]`` from the model itself."""
    rng = np.random.default_rng(0)
    truth = [rng.normal(size=(RUNS, PARTS))]
    for _ in range(FRAMES):
        truth.append(TRANSITION * truth[-1] + NOISE * rng.normal(size=(RUNS, PARTS)))
    truth = np.stack(truth[1:], axis=1)
    return truth, (truth + rng.normal(size=truth.shape))[..., None]


def ranks(order, factor=1.0):
    """``[R, T, P]``, 0 to 1; the filter believes in noises ``factor`` times as large."""
    one = jnp.ones((PARTS, 1, 1))
    tracker = jaxpf.Partitioned(
        dynamics=LinearGaussian(transition=TRANSITION * one, noise=factor * NOISE * one),
        likelihood=Gaussian(noise=factor * one),
        ordering=order,
        initial=IndependentGaussian(mean=np.zeros((PARTS, 1)), scale=np.array(1.0)),
        num_particles=300,
    )
    truth, frames = drawn()

    def record(state, summary):
        return jnp.exp(state.log_weights), state.substates[..., 0]

    def one_run(key, frames, truth):
        weights, values = jaxpf.run(tracker, key, frames, record)[1]
        return jnp.sum(weights[..., None] * (values < truth[:, None]), axis=1)

    keys = jax.random.split(jax.random.key(1), RUNS)
    return np.asarray(jax.jit(jax.vmap(one_run))(keys, frames, truth))


def p_values(found):
    """Of the chi-square test that ranks are uniform, by frame and partition."""
    counts = np.stack([np.histogram(x, BINS, (0, 1))[0] for x in found.reshape(RUNS, -1).T])
    return stats.chisquare(counts, axis=1).pvalue


@pytest.mark.slow
@pytest.mark.parametrize(
    "order",
    [ordering.ps([0, 1, 2]), ordering.dps(3), ordering.sps([-1, -1, -1])],
    ids=["ps", "dps", "sps"],
)
def test_ranks_of_the_truth_are_uniform(order):
    p = p_values(ranks(order))
    assert p.min() > 0.001 / p.size  # Bonferroni


@pytest.mark.slow
def test_a_filter_with_doubled_noises_fails():
    assert p_values(ranks(ordering.ps([0, 1, 2]), factor=2.0)).max() < 1e-6
