"""Quantiles of particles inside a record."""

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.filters import quantiles

LEVELS = [0.05, 0.5, 0.95]


def test_quantiles_in_a_record_are_those_of_the_states():
    tracker = jaxpf.state_space(
        initial=np.zeros(2),
        transition=lambda key, x, p: x + jax.random.normal(key, (2,)),
        log_likelihood=lambda y, x, p: -0.5 * jnp.sum((y - x) ** 2),
        num_particles=60,
    )
    frames = np.random.default_rng(0).normal(size=(4, 2))

    def record(state, summary):
        return state, quantiles(state.substates, state.log_weights, LEVELS)

    states, found = jaxpf.run(tracker, jax.random.key(0), frames, record=record)[1]
    assert found.shape == (4, 3, 1, 2)
    for time in range(4):
        state = jax.tree.map(lambda x, t=time: x[t], states)
        expected = quantiles(state.substates, state.log_weights, LEVELS)
        np.testing.assert_array_equal(found[time], expected)


def test_no_quantile_is_a_particle_without_weight():
    values = np.array([0.0, 1.0, 2.0])[:, None, None]
    log_weights = np.log([1e-300, 0.5, 0.5])
    log_weights[0] = -np.inf
    assert quantiles(values, log_weights, [0.0, 0.5, 1.0]).ravel().tolist() == [1, 1, 2]
