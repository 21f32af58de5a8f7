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


def test_quantiles_are_values_that_so_much_weight_reaches():
    values = np.array([3.0, 1.0, 2.0, np.nan])[:, None, None]
    log_weights = np.log([0.2, 0.3, 0.5, 1e-300])
    assert quantiles(values, log_weights, [0.25, 0.5, 0.79, 0.81])[:, 0, 0].tolist() == [1, 2, 2, 3]
    of_each = quantiles(np.tile(values, (1, 2, 1)), np.stack([log_weights] * 2), [0.5])
    assert of_each.tolist() == [[[2.0], [2.0]]]
    # Of particles that hold one target each, by the weight of those that hold it.
    held = np.array([[3.0, np.nan], [1.0, np.nan], [2.0, np.nan], [np.nan, 7.0]])[..., None]
    of_targets = quantiles(held, np.log([0.02, 0.03, 0.05, 0.9]), [0.25, 0.79, 1])[..., 0]
    assert of_targets.tolist() == [[1, 7], [2, 7], [3, 7]]
    assert np.isnan(quantiles(held[:3], np.log([0.2, 0.3, 0.5]), [0.5])[0, 1, 0])


def test_quantiles_without_any_weight_are_unknown():
    values = np.arange(6.0).reshape(3, 2, 1)
    assert np.isnan(quantiles(values, np.full(3, -np.inf), [0.5])).all()
    assert np.isnan(quantiles(values[:0], np.zeros(0), [0.1, 0.5])).all()
    of_each = quantiles(values, np.array([[0, 0, 0], [-np.inf] * 3]), [0.5])[0, :, 0]
    np.testing.assert_array_equal(of_each, [2, np.nan])
