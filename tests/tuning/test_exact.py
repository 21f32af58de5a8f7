"""Posteriors of a parameter against closed forms, where weights, inputs and gaps all count.

The smallest errors that were planted and found: a prior or an evidence to the power .95, but for
the prior of SMC^2, to the power .9.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pushed import FRAMES, INPUTS, draw_prior, exact, log_prior, model, z_scores

import jaxpf

pytestmark = pytest.mark.statistical

KEY = jax.random.key(3)
LIMIT = 4.5
#: Frames nearer to the prior, from which the draws of SMC^2 start.
NEAR = np.array([1.7, -2.9, np.nan, 3.3, -0.4])


@pytest.fixture(scope="module")
def drawn():
    return jaxpf.pmmh(
        model, log_prior, KEY, FRAMES, 0.4, inputs=INPUTS, paths=True, blocks=2,
        num_draws=100, num_warmup=100, num_chains=400, num_particles=24,
    )  # fmt: skip


def scores_of_chains(draws, mean, second):
    """z-scores of first and second moments, over independent chains."""
    draws = np.asarray(draws, float)
    return max(z_scores((draws**k).mean(1), m).max() for k, m in ((1, mean), (2, second)))


def test_pmmh_draws_the_parameter_from_its_posterior(drawn):
    (mean, *_), variance, _ = exact()
    variance = variance[0, 0]
    assert drawn.parameters.mean(1).std() < 0.5 * variance**0.5  # the chains mix
    assert scores_of_chains(drawn.parameters, mean, mean**2 + variance) < LIMIT


def test_pmmh_draws_paths_and_frames_of_their_own_time(drawn):
    mean, covariance, _ = exact()
    x, of_x = mean[2:], np.diag(covariance)[2:]
    paths = drawn.paths[..., 0, 0]
    assert scores_of_chains(paths, x, x**2 + of_x) < LIMIT
    together = paths * drawn.parameters[..., None]
    assert z_scores(together.mean(1), x * mean[0] + covariance[0, 2:]).max() < LIMIT
    y, of_y = x + INPUTS["offset"], of_x + INPUTS["noise"] ** 2
    assert scores_of_chains(drawn.frames, y, y**2 + of_y) < LIMIT


def test_smc2_has_the_posterior_and_the_evidence_after_every_frame():
    def one(key):
        found = jaxpf.tuning.smc2(
            model, log_prior, draw_prior, key, NEAR, inputs=INPUTS,
            num_draws=100, num_particles=10, num_moves=2, ess_threshold=0.9,
        )  # fmt: skip
        weights = jnp.exp(found.log_weights)
        last = jnp.stack([weights @ found.parameters, weights @ found.parameters**2])
        second = found.mean**2 + found.spread**2
        return found.mean, second, found.log_evidence, last, found.ess

    keys = jax.random.split(KEY, 300)
    found = jax.jit(lambda keys: jax.lax.map(one, keys))(keys)
    means, seconds, log_evidence, last, ess = (np.asarray(x, float) for x in found)
    answers = [exact(frames=NEAR[: count + 1]) for count in range(len(NEAR))]
    mean = np.array([answer.mean[0] for answer in answers])
    second = mean**2 + [answer.covariance[0, 0] for answer in answers]
    quotient = np.exp(np.cumsum(log_evidence, axis=1) - [answer.log_evidence for answer in answers])
    assert z_scores(means, mean).max() < LIMIT
    assert z_scores(seconds, second).max() < LIMIT
    assert z_scores(last, [mean[-1], second[-1]]).max() < LIMIT
    assert z_scores(quotient, 1).max() < LIMIT
    assert (ess.mean(0)[[0, 3]] < 90).all()  # the draws were moved, twice at least
