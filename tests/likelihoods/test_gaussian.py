"""The closed forms that other tests rest on, against SciPy and brute force."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from jaxpf.dynamics import LinearGaussian
from jaxpf.likelihoods import Gaussian, kalman, stacked_model

RNG = np.random.default_rng(0)


def lower(size, count):
    return np.tril(RNG.normal(size=(count, size, size))) + 2 * np.eye(size)


@pytest.mark.parametrize("observed", [False, True], ids=["itself", "projected"])
def test_gaussian_density_is_that_of_scipy(observed):
    noise = lower(2, 3)
    design = RNG.normal(size=(3, 2, 4)) if observed else None
    likelihood = Gaussian(noise=noise, observation=design)
    frame, substate = RNG.normal(size=(3, 2)), RNG.normal(size=4 if observed else 2)
    for part in range(3):
        seen = design[part] @ substate if observed else substate
        expected = multivariate_normal.logpdf(frame[part], seen, noise[part] @ noise[part].T)
        found = likelihood.log_prob(likelihood.observe(frame), part, jnp.asarray(substate))
        assert float(found) == pytest.approx(expected, rel=1e-4, abs=1e-4)


@pytest.mark.statistical
def test_gaussian_samples_have_its_mean_and_covariance():
    """Noise that is correlated; 40 000 draws tell a standard deviation that is 2 percent off."""
    rng = np.random.default_rng(1)
    noise, design = np.array([[[1, 0], [2, 0.5]], [[0.5, 0], [-1, 1]]]), rng.normal(size=(2, 2, 3))
    substates = rng.normal(size=(2, 3))
    likelihood = Gaussian(noise=noise, observation=design)
    keys = jax.random.split(jax.random.key(0), 40_000)
    drawn = jax.vmap(lambda key: likelihood.sample(key, jnp.asarray(substates)))(keys)
    off = np.asarray(drawn, float) - np.einsum("ped,pd->pe", design, substates)
    off = off.reshape(len(keys), -1)
    covariance = block_diag(*(root @ root.T for root in noise))
    for found, expected in ((off, 0), (off[:, :, None] * off[:, None], covariance)):
        error = found.std(axis=0) / len(keys) ** 0.5
        assert np.abs((found.mean(axis=0) - expected) / error).max() < 4.5


def test_correlated_gaussian_has_its_joint_density_and_its_margins():
    root = lower(3, 1)[0]
    covariance = root @ root.T
    likelihood = CorrelatedGaussian(covariance=jnp.asarray(covariance))
    frame, substates = RNG.normal(size=3), RNG.normal(size=(3, 1))
    margins = [likelihood.log_prob(jnp.asarray(frame), p, substates[p]) for p in range(3)]
    for part in range(3):
        expected = multivariate_normal.logpdf(
            frame[part], substates[part, 0], covariance[part, part]
        )
        assert float(margins[part]) == pytest.approx(expected, rel=1e-4)
    joint = likelihood.log_joint(jnp.asarray(frame), jnp.asarray(substates), jnp.array(margins))
    expected = multivariate_normal.logpdf(frame, substates[:, 0], covariance)
    assert float(joint) == pytest.approx(expected, rel=1e-4)
    assert float(joint) != pytest.approx(float(sum(margins)), rel=1e-2)


def joint_gaussian(transition, process, observation, noise, mean, covariance, steps):
    """Means and covariance of ``(z_1..z_T, y_1..y_T)``, written out."""
    size = len(transition)
    # z_t = A^t z_0 + sum_s A^(t-s) q_s: a linear map of (z_0, q_1, .., q_T).
    power = [np.linalg.matrix_power(transition, k) for k in range(steps + 1)]
    blocks = np.zeros((steps * size, (steps + 1) * size))
    for t in range(1, steps + 1):
        for s in range(t + 1):
            blocks[(t - 1) * size : t * size, s * size : (s + 1) * size] = power[t - s]
    sources = np.kron(np.eye(steps + 1), process)
    sources[:size, :size] = covariance
    states = blocks @ sources @ blocks.T
    state_mean = blocks[:, :size] @ mean
    lift = np.kron(np.eye(steps), observation)
    observed = lift @ states @ lift.T + np.kron(np.eye(steps), noise)
    return state_mean, states, lift @ state_mean, observed, states @ lift.T


def test_kalman_is_the_conditional_of_the_joint_gaussian():
    steps, size = 3, 2
    transition, observation = RNG.normal(size=(size, size)), RNG.normal(size=(1, size))
    process, noise, covariance = np.diag([0.5, 1.5]), np.array([[0.7]]), np.diag([1.0, 0.3])
    mean, frames = np.array([1.0, -1.0]), RNG.normal(size=(steps, 1))
    log_evidence, means, covariances = kalman(
        transition, process, observation, noise, mean, covariance, frames
    )
    for t in range(1, steps + 1):
        state_mean, states, seen_mean, seen, cross = joint_gaussian(
            transition, process, observation, noise, mean, covariance, t
        )
        y = frames[:t].ravel()
        assert log_evidence[:t].sum() == pytest.approx(
            multivariate_normal.logpdf(y, seen_mean, seen)
        )
        last = slice((t - 1) * size, t * size)
        gain = np.linalg.solve(seen, cross[last].T).T
        np.testing.assert_allclose(means[t - 1], state_mean[last] + gain @ (y - seen_mean))
        np.testing.assert_allclose(
            covariances[t - 1], states[last, last] - gain @ cross[last].T, atol=1e-12
        )


def test_stacked_model_moves_parts_as_the_dynamics_do():
    parents = (-1, 0, 1, 0)
    dynamics = LinearGaussian(
        transition=RNG.normal(size=(4, 2, 2)),
        noise=RNG.normal(size=(4, 2, 2)),
        lag=RNG.normal(size=(4, 2, 2)),
        coupling=RNG.normal(size=(4, 2, 2)),
    )
    transition, process = stacked_model(dynamics, parents)
    current, previous = RNG.normal(size=(2, 4, 2))
    noise = RNG.normal(size=(4, 2))

    def moved(noise):
        new = np.zeros((4, 2))
        for part, parent in enumerate(parents):
            new[part] = (
                dynamics.transition[part] @ current[part]
                + dynamics.lag[part] @ previous[part]
                + dynamics.noise[part] @ noise[part]
            )
            if parent >= 0:
                new[part] += dynamics.coupling[part] @ new[parent]
        return new.ravel()

    stacked = transition @ np.concatenate([current.ravel(), previous.ravel()])
    np.testing.assert_allclose(stacked[:8], moved(0 * noise))
    np.testing.assert_allclose(stacked[8:], current.ravel())
    # Columns of the noise's map, hence its covariance.
    columns = np.stack([moved(unit.reshape(4, 2)) - moved(0 * noise) for unit in np.eye(8)], axis=1)
    np.testing.assert_allclose(process[:8, :8], columns @ columns.T, atol=1e-12)
    assert not process[8:].any()
    assert not process[:, 8:].any()


def test_kalman_takes_lists():
    model = [[0.9]], [[0.5]], [[1.0]], [[0.7]], [0.0], [[1.0]], [[0.3], [np.nan]]
    given = kalman(*model), kalman(*map(np.array, model))
    for lists, arrays in zip(*given, strict=True):
        np.testing.assert_array_equal(lists, arrays)
