"""Draws from a model: their moments, and the coverage of predictive intervals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, TREE, WRONG, problem
from models import space

import jaxpf
from jaxpf import InputError
from jaxpf.likelihoods import stacked_model

KEY = jax.random.key(5)
NUM_DRAWS = 4000


def seen(key, x, p):
    return x + p["noise"] * jax.random.normal(key)


@pytest.mark.statistical
@pytest.mark.slow
def test_moments_of_simulated_parts_are_those_of_the_model():
    """Second moments of the observations of a part tree; those of the states differ."""
    its = problem(TREE)
    drawn = jaxpf.simulate(its.tracker(jaxpf.ordering.ps([0, 1, 2])), KEY, 2, num_draws=NUM_DRAWS)
    system, process = stacked_model(its.dynamics, TREE)
    covariance = np.zeros((6, 6))
    for _ in range(2):
        covariance = system @ covariance @ system.T + process

    def score(values):
        values = np.asarray(values)[:, -1, :, 0]
        products = values[:, :, None] * values[:, None, :]
        error = products.std(0) / NUM_DRAWS**0.5
        return np.abs((products.mean(0) - covariance[:3, :3] - np.eye(3)) / error).max()

    assert score(drawn.frames) < LIMIT
    assert score(drawn.states) > WRONG


@pytest.mark.statistical
@pytest.mark.slow
def test_predictive_intervals_cover_95_percent():
    """Of simulated futures; intervals of the state instead are too narrow."""

    def covered(key):
        keys = jax.random.split(key, 3)
        tracker = space(observation=seen, num_particles=100)
        its = jaxpf.simulate(tracker, keys[0], 7)
        state, _ = jaxpf.run(tracker, keys[1], its.frames[:5])
        ahead = jaxpf.simulate(tracker, keys[2], 2, state=state, num_draws=250)
        of_states = ahead._replace(frames=ahead.states[..., 0, 0])
        ends = jnp.array([each.interval(0.95) for each in (ahead, of_states)])
        return (ends[:, 0] <= its.frames[5:]) & (its.frames[5:] <= ends[:, 1])

    share = np.asarray(jax.jit(jax.vmap(covered))(jax.random.split(KEY, 500))).mean(0)
    right, wrong = (share - 0.95) / (0.95 * 0.05 / 500) ** 0.5
    assert np.abs(right).max() < LIMIT
    assert wrong.max() < -WRONG / 2


def test_states_of_a_tree_inputs_and_time_are_drawn_by_name():
    its = jaxpf.state_space(
        initial={"at": 0.0, "turns": jnp.int32(0)},
        transition=lambda key, x, p, u: {"at": x["at"] + u, "turns": x["turns"] + 1},
        log_likelihood=lambda y, x, p: 0.0,
        observation=lambda key, x, p, time: {"sum": x["at"], "time": time},
    )
    states, frames = jaxpf.simulate(its, KEY, 3, inputs=np.array([1.0, 2.0, 4.0]))
    np.testing.assert_array_equal(states["turns"], [1, 2, 3])
    np.testing.assert_array_equal(frames["sum"], [1, 3, 7])
    state = jaxpf.run(its, KEY, np.zeros(3), inputs=np.ones(3))[0]
    later = jaxpf.simulate(its, KEY, 2, inputs=np.ones(2), state=state, num_draws=4)
    np.testing.assert_array_equal(later.frames["time"], [[3, 4]] * 4)


@pytest.mark.statistical
def test_a_particle_is_drawn_by_its_weight_and_goes_on_with_the_rows_of_its_frames():
    """Five particles of unequal weight, each known by a number of its own."""
    its = jaxpf.state_space(
        initial=lambda key, p: jnp.stack([jax.random.normal(key), 0.0]),
        transition=lambda key, x, p, u: x.at[1].add(u),
        log_likelihood=lambda y, x, p: x[0] * y,
        observation=lambda key, x, p, u: jnp.stack([*x, u]),
        num_particles=5,
    )
    rows, draws = 2.0 ** np.arange(5), 20_000
    state, _ = jaxpf.run(its, KEY, np.ones(2), inputs=rows[:2])
    later = jaxpf.simulate(its, KEY, 3, inputs=rows[2:], state=state, num_draws=draws)
    number, total, given = np.moveaxis(later.frames, -1, 0)
    np.testing.assert_array_equal(given, np.tile(rows[2:], (draws, 1)))
    np.testing.assert_array_equal(total, np.tile(np.cumsum(rows)[2:], (draws, 1)))
    numbers, weights = state.substates[:, 0, 0], np.exp(state.log_weights)
    assert weights.max() > 2 * weights.min()
    for one in np.unique(numbers):
        expected, share = weights[numbers == one].sum(), np.mean(number == one)
        assert abs(share - expected) < LIMIT * (expected * (1 - expected) / draws) ** 0.5


def test_a_model_that_draws_no_observations_is_refused():
    with pytest.raises(InputError, match="draws no observations; write its method sample"):
        jaxpf.simulate(space(), KEY, 3)
