"""Settings weighed by the evidence of a few frames."""

import jax
import numpy as np
from scipy.stats import multivariate_normal

from jaxpf import Partitioned, dynamics, likelihoods, ordering
from jaxpf.tuning.evidence import log_evidences

SCALES = (0.2, 1.0, 4.0)


def test_evidences_are_those_of_the_exact_marginals_and_find_the_noise():
    rng = np.random.default_rng(3)
    frames = (np.cumsum(rng.normal(size=(8, 1)), axis=0) + rng.normal(size=(8, 1))).astype("f4")
    trackers = [
        Partitioned(
            dynamics=dynamics.RandomWalk(scale=np.float32(scale)),
            likelihood=likelihoods.Gaussian(noise=np.ones((1, 1, 1), np.float32)),
            ordering=ordering.sir(1),
            initial=np.zeros((1, 1), np.float32),
            num_particles=1000,
        )
        for scale in SCALES
    ]
    found = log_evidences(trackers, jax.random.key(0), frames[..., None], num_runs=8)
    steps = np.arange(1, 9)
    covariances = [scale**2 * np.minimum.outer(steps, steps) + np.eye(8) for scale in SCALES]
    exact = [multivariate_normal(np.zeros(8), c).logpdf(frames[:, 0]) for c in covariances]
    # The log of a mean of 8 runs deviates by some .05; more where the noise is small or large.
    np.testing.assert_allclose(found, exact, atol=0.3)
    assert np.argmax(found) == np.argmax(exact)
