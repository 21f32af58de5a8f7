"""What a proposal is given, and the density of a mixture.

Combinations with other features are compared with exact filters in tests/statistical.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

import jaxpf
from jaxpf import pytree_dataclass
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian
from jaxpf.proposals import LocallyOptimal, Mixture

KEY = jax.random.key(0)
INPUTS = np.float32([1.0, -2.0, 4.0, 3.0])
Y = np.float32([1.5, 0.3, 2.0, 3.3])
normal = jax.scipy.stats.norm.logpdf


def noise_at(time):
    """Standard deviation of the observation."""
    return 0.5 + 0.5 * time


@pytree_dataclass
class Optimal(jaxpf.contract.Proposal):
    """Of ``x_t = p u_t + n`` and an observation whose noise grows with time."""

    inputs: Any = None
    moment: Any = None
    parameters: Any = None

    def with_inputs(self, inputs, first):
        return dataclasses.replace(self, inputs=(inputs, first))

    def at_frame(self, time):
        values, first = self.inputs
        return dataclasses.replace(self, moment=(time, jnp.asarray(values)[time - first]))

    def of_model(self, dynamics, likelihood):
        return dataclasses.replace(self, parameters=dynamics.parameters)

    def moments(self, observation):
        time, u = self.moment
        gain = 1 / (1 + noise_at(time) ** 2)
        mean = self.parameters * u
        return mean + gain * (observation - mean), jnp.sqrt(1 - gain)

    def propose(self, key, observation, partition, current, previous, parent):
        mean, scale = self.moments(observation)
        return mean + scale * jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        return normal(new[0], *self.moments(observation))


def sees(y, x, p, time):
    return normal(y, x, noise_at(time))


def sees_both(y, x, p, time, previous):
    return sees(y, x, p, time) + 0 * previous


@pytest.mark.parametrize(
    ("log_likelihood", "wrapped"),
    [
        (sees, lambda x: Mixture(x, share=0.9999)),
        (sees_both, lambda x: x),
        pytest.param(sees, lambda x: x, marks=pytest.mark.slow),
        pytest.param(sees_both, lambda x: Mixture(x, share=0.9999), marks=pytest.mark.slow),
    ],
)
def test_a_proposal_receives_time_inputs_and_parameters(log_likelihood, wrapped):
    """The optimal one of states that forget their past: all particles get the exact evidence."""
    its = jaxpf.state_space(
        initial=0.0,
        transition=lambda key, x, p, u: p * u + jax.random.normal(key),
        transition_log_density=lambda new, x, p, u: normal(new, p * u),
        log_likelihood=log_likelihood,
        parameters=0.7,
        num_particles=20,
        proposal=wrapped(Optimal()),
    )
    changed = jaxpf.tuning.replace(its, {"parameters": 0.8})
    state, _ = jaxpf.run(changed, KEY, Y[:1], inputs=INPUTS[:1])
    summary = jaxpf.run(changed, KEY, Y[1:], inputs=INPUTS[1:], state=state)[1]
    exact = normal(Y, 0.8 * INPUTS, np.sqrt(1 + noise_at(np.arange(4)) ** 2))[1:]
    np.testing.assert_allclose(summary.log_evidence, exact, atol=1e-3)
    np.testing.assert_allclose(summary.ess, 20, rtol=1e-3)


def test_the_density_of_a_mixture_is_that_of_both():
    """Of the optimal normal in two correlated dimensions, and of the walk beside it."""
    root, scale = np.array([[0.5, 0.0], [0.4, 0.3]]), np.array([1.0, 2.0])
    likelihood = Gaussian(noise=root[None])
    walk, frame, past = RandomWalk(scale), np.array([[1.5, -0.5]]), np.array([0.3, -1.0])
    mixture = Mixture(LocallyOptimal(), 0.7)
    mixture = mixture.of_model(walk, likelihood)
    new = np.random.default_rng(0).normal([1.0, -0.5], size=(6, 2))
    column = jnp.repeat(jnp.asarray(past)[:, None], 6, axis=1)
    found = jax.jit(mixture.log_density_all)(
        frame, jnp.zeros(6, jnp.int32), jnp.asarray(new.T), column, column, 0 * column
    )
    before, seen = np.diag(1 / scale**2), np.linalg.inv(root @ root.T)
    covariance = np.linalg.inv(before + seen)
    optimal = multivariate_normal(covariance @ (before @ past + seen @ frame[0]), covariance)
    moved = multivariate_normal(past, np.diag(scale**2))
    expected = np.log(0.7 * optimal.pdf(new) + 0.3 * moved.pdf(new))
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)
