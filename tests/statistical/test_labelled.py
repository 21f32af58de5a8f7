"""The labelled filter against Kalman: what is unbiased in which variant, and what is not.

``plain`` and ``corrected`` carry masses; ``equal_share`` (eq. 4 as printed) has each label's own
evidence instead.  Products over labels are unbiased where labels are independent given how many
particles each has, and nowhere else.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from exact import COMPILER_OPTIONS, LIMIT, WRONG
from labelled_targets import (
    PARTICLES,
    TARGETS,
    label_scores,
    mass_scores,
    mixture_score,
    product_score,
    recorded,
    targets,
)

import jaxpf
from jaxpf.filters.labelled import kernel
from jaxpf.gradients import StopGradient
from jaxpf.likelihoods import kalman

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


@pytest.fixture(scope="module")
def exact():
    return targets()


@pytest.fixture(scope="module")
def runs(exact):
    """Multinomial runs of each of the three ways to weigh."""
    return {
        weights: recorded(exact, weights=weights, resampling="multinomial")
        for weights in ("equal_share", "plain", "corrected")
    }


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_carried_masses_and_their_moments_are_unbiased(exact, runs, weights):
    """E[L Z^ W_l] = Z_l, and with x and x^2."""
    assert np.abs(mass_scores(exact, runs[weights])).max() < LIMIT


@pytest.mark.parametrize("weights", ["equal_share", "plain", "corrected"])
def test_the_evidence_is_that_of_the_mixture(exact, runs, weights):
    assert abs(mixture_score(exact, runs[weights])) < LIMIT


def test_equal_shares_keep_each_targets_own_evidence_and_moments_unbiased(exact, runs):
    found = runs["equal_share"]
    assert not found[4].any()  # no label was ever empty
    assert np.abs(label_scores(exact, found)).max() < LIMIT


def test_equal_shares_keep_the_product_over_labels_unbiased(exact, runs):
    assert abs(product_score(exact, runs["equal_share"])) < LIMIT


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_products_of_carried_masses_are_biased(exact, runs, weights):
    """Masses share one set: where one label has more than its due, another has less."""
    assert product_score(exact, runs[weights]) < -WRONG


def test_equal_shares_as_printed_make_all_masses_equal(exact, runs):
    sums = runs["equal_share"][2][:, -1, :, 0]
    np.testing.assert_allclose(sums, 1 / TARGETS, rtol=1e-9)
    assert np.abs(mass_scores(exact, runs["equal_share"])).max() > WRONG


def test_corrected_evidence_of_systematic_resampling_is_unbiased(exact):
    found = recorded(exact, weights="corrected", resampling="systematic")
    assert np.abs(mass_scores(exact, found)).max() < LIMIT
    assert abs(mixture_score(exact, found)) < LIMIT


def test_counts_per_label_are_multinomial_under_equal_shares(runs):
    counts = runs["equal_share"][3]  # [R, T, L]; the first frame is not resampled
    assert (counts[:, 0] == PARTICLES // TARGETS).all()
    edges = np.arange(6, 19)
    law = scipy.stats.binom(PARTICLES, 1 / TARGETS)
    expected = np.diff(law.cdf(np.concatenate([[-1], edges, [PARTICLES]])))
    for label in range(TARGETS):
        found = np.bincount(np.searchsorted(edges, counts[:, -1, label]), minlength=len(expected))
        assert scipy.stats.chisquare(found, expected * len(counts)).pvalue > 1e-4
    # Plain weights: the more likely targets have more, by far.
    plain = np.bincount(np.searchsorted(edges, runs["plain"][3][:, -1, 0]), minlength=len(expected))
    assert scipy.stats.chisquare(plain, expected * len(counts)).pvalue < 1e-12


def test_plain_weights_lose_a_label_where_equal_shares_do_not(exact):
    lost = {
        weights: recorded(exact, weights=weights, num_particles=16)[4][:, -1].any(axis=1).mean()
        for weights in ("plain", "equal_share")
    }
    assert lost["plain"] > 0.05
    assert lost["equal_share"] == 0.0


def test_the_gradient_of_the_evidence_is_exact_in_expectation(exact):
    """d log (1/L) sum Z_l by the observation noise, against differences of Kalman's."""
    keys = jax.random.split(jax.random.key(2), 4000)
    tracker = exact.tracker(gradient=StopGradient(), resampling="multinomial")

    def scaled(noise):
        likelihood = dataclasses.replace(tracker.likelihood, noise=noise * jnp.ones((4, 1, 1)))
        return dataclasses.replace(tracker, likelihood=likelihood)

    def estimate(noise, key):
        _, summary = jaxpf.run(scaled(noise), key, exact.problem.frames)
        return jnp.exp(jnp.sum(summary.log_evidence))

    def answer(noise):
        system = np.array([[0.7, 0.3], [1.0, 0.0]])
        process, seen, start = np.diag([1.0, 0.0]), np.array([[1.0, 0.0]]), np.ones((2, 2))
        noise = noise**2 * np.eye(1)
        every = [
            kalman(system, process, seen, noise, np.zeros(2), start, frames)[0].sum()
            for frames in np.swapaxes(exact.problem.frames, 0, 1)
        ]
        return np.mean(np.exp(every))

    slope = jax.jit(jax.vmap(jax.grad(estimate), (None, 0)), compiler_options=COMPILER_OPTIONS)
    slopes = np.asarray(slope(1.0, keys))
    expected = (answer(1 + 1e-5) - answer(1 - 1e-5)) / 2e-5
    error = slopes.std() / len(slopes) ** 0.5
    assert abs(slopes.mean() - expected) / error < LIMIT
    assert abs(expected) / error > WRONG  # it could have failed


def test_kills_weights_that_are_not_divided_by_the_shares(exact, monkeypatch):
    """Selected by eq. 4 with equal weights after it: masses are wrong."""
    original = kernel.select

    def mutant(tracker, key, state):
        chosen = original(tracker, key, state)
        uniform = jnp.full_like(chosen.log_weights, -np.log(PARTICLES))
        return dataclasses.replace(chosen, log_weights=uniform)

    monkeypatch.setattr(kernel, "select", mutant)
    # Another number of runs per batch: a compiled kernel would hide the mutation.
    found = recorded(exact, weights="corrected", resampling="multinomial", batch=1000)
    assert np.abs(mass_scores(exact, found)).max() > WRONG
