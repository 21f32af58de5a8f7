"""An open population: who comes gets a fair share, who goes leaves the others alone."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import multivariate_normal
from models import start, step
from records import z_score

import jaxpf
from jaxpf.dynamics import AR2, LinearGaussian
from jaxpf.filters import add_target, remove_target
from jaxpf.likelihoods import Gaussian

FRAMES = np.random.default_rng(0).normal(size=(6, 4, 2)).astype(np.float32).cumsum(axis=0)
EMPTY = np.full((4, 2), np.nan, np.float32)
NOISE = 0.5


def tracker(initial=EMPTY, **settings):
    likelihood = Gaussian(noise=np.tile(NOISE * np.eye(2, dtype=np.float32), (4, 1, 1)))
    defaults = {"num_particles": 60, "population": "open"}
    dynamics = AR2(scale=np.full(2, settings.pop("scale", 1.0), np.float32))
    return jaxpf.Labelled(dynamics, likelihood, initial, **(defaults | settings))


def some(*slots):
    """Initial states in which these slots hold a target."""
    initial = EMPTY.copy()
    initial[list(slots)] = np.arange(8, dtype=np.float32).reshape(4, 2)[list(slots)]
    return initial


def after_frames(chosen, number=2):
    """State and summary, in NumPy arrays, after some frames."""
    state = start(chosen)
    for time in range(number):
        state, summary = step(chosen, jax.random.key(time), state, FRAMES[time])
    return state, jax.tree.map(np.asarray, summary)


def weight_of(state):
    weights = np.exp(np.asarray(state.log_weights))
    return np.bincount(np.asarray(state.labels), weights, minlength=4)


def test_with_all_slots_taken_it_is_the_fixed_population_bit_for_bit():
    initial = some(0, 1, 2, 3)
    one, other = (
        after_frames(tracker(initial, population=name), 4)[1] for name in ("open", "fixed")
    )
    fields = "estimate log_evidence ess_parts label_log_evidence without_likelihood status"
    for name in fields.split():
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_empty_slots_have_no_weight_and_report_nothing():
    state, summary = after_frames(tracker(some(1, 3)))
    np.testing.assert_allclose(weight_of(state), [0, 0.5, 0, 0.5], atol=1e-5)
    assert summary.alive.tolist() == [False, True, False, True]
    assert np.isnan(summary.estimate[[0, 2]]).all()
    assert np.isfinite(summary.estimate[[1, 3]]).all()
    assert not summary.without_likelihood.any()
    assert summary.status == 0
    assert summary.ess >= 1
    assert np.isfinite(summary.log_evidence)
    np.testing.assert_allclose(summary.distinct_share, [0, 0.5, 0, 0.5], atol=0.05)


def test_who_ends_leaves_the_others_their_particles_and_then_his_own():
    chosen = tracker(some(0, 1, 2))
    state, _ = after_frames(chosen)
    after = remove_target(state, 1)
    np.testing.assert_array_equal(after.lagged, state.lagged)
    np.testing.assert_array_equal(after.labels, state.labels)
    others = np.asarray(state.labels) != 1
    # The rest is one again, each particle of it in proportion.
    gain = np.asarray(after.log_weights - state.log_weights)[others]
    np.testing.assert_allclose(gain, np.log(1.5), rtol=1e-5)
    assert np.isneginf(np.asarray(after.log_weights)[~others]).all()
    np.testing.assert_allclose(np.exp(after.log_mass).sum(), 1, rtol=1e-5)
    later, summary = step(chosen, jax.random.key(9), after, FRAMES[2])
    assert not np.any(np.asarray(later.labels) == 1)
    np.testing.assert_allclose(summary.distinct_share, [0.5, 0, 0.5, 0], atol=0.04)


def test_who_is_born_starts_in_his_place_with_a_fair_share():
    chosen = tracker(some(0, 2), scale=0.0)
    state, _ = after_frames(chosen)
    place = np.array([30.0, -7.0], np.float32)
    after = add_target(state, 3, place)
    for name in ("lagged", "labels", "log_weights"):
        np.testing.assert_array_equal(getattr(after, name), getattr(state, name))
    np.testing.assert_allclose(np.exp(after.log_mass)[3], 1 / 3, rtol=1e-5)
    np.testing.assert_allclose(np.exp(after.log_mass).sum(), 1, rtol=1e-5)
    later, summary = step(chosen, jax.random.key(9), after, FRAMES[2])
    np.testing.assert_allclose(summary.estimate[3], place, rtol=1e-6)
    np.testing.assert_allclose(weight_of(later), [1 / 3, 0, 1 / 3, 1 / 3], rtol=1e-4)
    assert not later.newborn.any()
    # A third of the particles at once, taken from both.
    assert np.bincount(later.labels, minlength=4).tolist() == [20, 0, 20, 20]
    # The others are where they would have been.
    alone, _ = step(chosen, jax.random.key(9), state, FRAMES[2])
    kept = np.asarray(later.labels) != 3
    np.testing.assert_array_equal(later.lagged[..., kept], alone.lagged[..., kept])


@pytest.mark.slow
def test_the_evidence_of_a_newborn_and_of_the_others_is_unbiased():
    """One frame after a target is added, against the exact answer; 4000 runs."""
    chosen = tracker(some(0, 2), num_particles=12, resampling="multinomial")
    place, frame = np.array([1.0, 2.0], np.float32), FRAMES[0]

    def run(key):
        first, second = jax.random.split(key)
        state, _ = chosen.step(first, chosen.init(key), FRAMES[1])
        _, summary = chosen.step(second, add_target(state, 1, place), frame)
        return summary.label_log_evidence[1], summary.log_evidence

    own, mixture = jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(0), 4000))
    exact = np.exp(multivariate_normal.logpdf(frame[1], place, (1 + NOISE**2) * jnp.eye(2)))
    ratio = np.exp(np.asarray(own, float)) / exact
    assert z_score(ratio, 1) < 4.5
    assert ratio.std() < 2
    assert np.isfinite(mixture).all()


def test_an_empty_population_waits_and_its_first_target_gets_everything():
    chosen = tracker()
    state, summary = after_frames(chosen)
    assert summary.log_evidence == 0
    assert summary.status == 0
    assert summary.ess == 0
    state, summary = step(chosen, jax.random.key(3), add_target(state, 2, [1.0, 1.0]), FRAMES[2])
    np.testing.assert_allclose(weight_of(state), [0, 0, 1, 0], atol=1e-6)
    assert summary.distinct_share[2] == 1
    assert np.isfinite(summary.log_evidence)
    emptied, summary = step(chosen, jax.random.key(4), remove_target(state, 2), FRAMES[3])
    assert not np.isnan(emptied.log_weights).any()
    assert not summary.alive.any()
    # A slot is used again in the frame in which it was left.
    again = add_target(remove_target(state, 2), 2, [5.0, 5.0])
    _, summary = step(chosen, jax.random.key(4), again, FRAMES[3])
    assert np.abs(summary.estimate[2] - 5).max() < 5


def test_added_and_removed_targets_compile_nothing_anew():
    traces = []

    class Counting(Gaussian):
        def log_prob_all(self, *arguments):
            traces.append(1)
            return super().log_prob_all(*arguments)

    likelihood = jaxpf.pytree_dataclass(Counting)(noise=tracker().likelihood.noise)
    chosen = dataclasses.replace(tracker(), likelihood=likelihood)
    state, _ = step(chosen, jax.random.key(1), start(chosen), FRAMES[0])
    once = len(traces)
    for slot in (2, 0, 1, 3):
        state = add_target(state, slot, FRAMES[0, slot])
        state, _ = step(chosen, jax.random.key(slot), state, FRAMES[1])
        state = remove_target(state, slot) if slot else state
    assert once == len(traces) == 1


def test_one_frame_without_likelihood_is_left_out_for_a_targets_mass():
    chosen = tracker(some(0, 1))
    state, _ = after_frames(chosen)
    before = np.exp(state.log_mass)
    hidden = FRAMES[2].copy()
    hidden[1] = 1e20
    state, summary = step(chosen, jax.random.key(5), state, hidden)
    assert summary.without_likelihood.tolist() == [False, True, False, False]
    assert np.isfinite(summary.log_evidence)
    np.testing.assert_allclose(np.exp(state.log_mass), before, rtol=1e-4)
    # Whoever comes and goes, masses sum to one, and who is left fits.
    for change in (
        lambda s: add_target(s, 3, FRAMES[3, 3]),
        lambda s: remove_target(s, 0),
        lambda s: remove_target(s, 3),
    ):
        state = change(state)
        np.testing.assert_allclose(np.exp(state.log_mass).sum(), 1, rtol=1e-5)
    _, summary = step(chosen, jax.random.key(6), state, FRAMES[3])
    assert np.isfinite(summary.log_evidence)


@pytest.mark.parametrize("speed", [None, (0, 1)])
def test_who_is_born_has_the_speed_that_was_given(speed):
    """Of substates that hold a speed; with feedback it moves by it."""
    model = {"feedback": "estimate", "position": (2, 3), "speed": (0, 1)} if speed else {}
    dynamics = LinearGaussian(
        transition=np.eye(4, dtype=np.float32)[None] + np.eye(4, k=-2, dtype=np.float32)[None],
        noise=np.zeros((1, 4, 4), np.float32),
    )
    likelihood = Flat()
    initial = np.full((2, 4), np.nan, np.float32)
    initial[0] = 0
    chosen = jaxpf.Labelled(
        dynamics, likelihood, initial, population="open", num_particles=20, **model
    )
    state = add_target(start(chosen), 1, [3.0, -1.0, 10.0, 20.0])
    for time in (1, 2):
        state, summary = step(chosen, jax.random.key(time), state, FRAMES[0])
        place = [3, -1, 10 + 3 * time, 20 - time]
        np.testing.assert_allclose(summary.estimate[1], place, rtol=1e-5)


@jaxpf.pytree_dataclass
class Flat:
    """Nothing is seen."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return jnp.zeros(())
