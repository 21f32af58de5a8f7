"""Components of a frame that are missing: the others keep their marginal density."""

import jax
import numpy as np
import pytest
from exact import LIMIT
from scipy.stats import multivariate_normal

import jaxpf
from jaxpf import ordering
from jaxpf.dynamics import LinearGaussian
from jaxpf.likelihoods import Gaussian, kalman

P, E, D, T = 2, 3, 2, 4
RNG = np.random.default_rng(0)
NOISE = np.tril(RNG.normal(size=(P, E, E))) + np.eye(E)
SEES = RNG.normal(size=(P, E, D))
FRAMES = RNG.normal(size=(T, P, E))
SEEN = RNG.random((T, P, E)) < 0.6
SEEN[1], SEEN[2, 0], SEEN[3] = False, False, True
LIKELIHOOD = Gaussian(NOISE, SEES)


@jax.jit
def densities(frame, partition, points):
    """Log densities, and the slopes of their sum."""

    def total(points):
        found = LIKELIHOOD.log_prob_all(frame, partition, points)
        return found.sum(), found

    slope, found = jax.grad(total, has_aux=True)(points)
    return found, slope


def test_the_density_is_that_of_the_components_that_were_seen():
    points = RNG.normal(size=(D, 5))
    for frame, seen in zip(FRAMES, SEEN, strict=True):
        for p in range(P):
            covariance = (NOISE[p] @ NOISE[p].T)[np.ix_(seen[p], seen[p])]
            mean = (SEES[p] @ points)[seen[p]]
            expected = [
                multivariate_normal.logpdf(frame[p, seen[p]], m, covariance) if seen[p].any() else 0
                for m in mean.T
            ]

            found, slope = densities(np.where(seen, frame, np.nan), p, points)
            np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)
            assert np.isfinite(slope).all()


def tracker(num_particles=400):
    one = np.broadcast_to(np.eye(D), (P, D, D))
    return jaxpf.Partitioned(
        dynamics=LinearGaussian(0.8 * one, one),
        likelihood=LIKELIHOOD,
        initial=np.zeros((P, D)),
        ordering=ordering.ps([0, 1]),
        num_particles=num_particles,
    )


@pytest.mark.slow
@pytest.mark.statistical
def test_the_evidence_is_unbiased():
    eye, size = np.eye(P * D), P * D
    sees, covariance = np.zeros((P * E, size)), np.zeros((P * E, P * E))
    for p in range(P):
        rows = slice(p * E, (p + 1) * E)
        sees[rows, p * D : (p + 1) * D] = SEES[p]
        covariance[rows, rows] = NOISE[p] @ NOISE[p].T
    frames = np.where(SEEN, FRAMES, np.nan).reshape(T, -1)
    exact = kalman(0.8 * eye, eye, sees, covariance, np.zeros(size), 0 * eye, frames)[0].sum()
    keys = jax.random.split(jax.random.key(0), 4000)
    found = jaxpf.monte_carlo(
        tracker(), keys, FRAMES, record=lambda state, summary: summary.log_evidence, observed=SEEN
    )
    ratio = np.exp(np.asarray(found, float).sum(axis=1) - exact)
    assert abs(ratio.mean() - 1) < LIMIT * ratio.std(ddof=1) / len(ratio) ** 0.5
    assert ratio.std() / len(ratio) ** 0.5 < 0.01  # a bias of 5% would be seen


@pytest.mark.slow
@pytest.mark.always
def test_nan_and_observed_say_the_same():
    key = jax.random.key(1)
    told = jaxpf.run(tracker(), key, FRAMES, observed=SEEN)[1]
    marked = jaxpf.run(tracker(), key, np.where(SEEN, FRAMES, np.nan))[1]
    np.testing.assert_array_equal(told.estimate, marked.estimate)
    assert told.log_evidence[1] == 0  # nothing was seen
    # Partitions that were seen, and components of them that were not.
    parts = SEEN.any(axis=2)
    both = jaxpf.run(tracker(), key, np.where(SEEN, FRAMES, np.nan), observed=parts)[1]
    np.testing.assert_allclose(both.log_evidence, told.log_evidence, rtol=1e-5, atol=1e-5)
