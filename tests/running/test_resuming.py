"""A resumed run continues the run: the state carries its own time, which selects the noise."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT
from models import walk, walks
from records import assert_equal, everything

import jaxpf
from jaxpf import InputError
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.likelihoods import kalman

KEY = jax.random.key(3)
FRAMES = np.random.default_rng(0).normal(size=(4, 2, 1)).astype(np.float32)
MODEL = walks() | {"initial": np.array([[0.0], [1.0]], np.float32), "num_particles": 6}


def partitioned():
    return jaxpf.Partitioned(**MODEL, ordering=jaxpf.ordering.ps([0, 1]), resampling="multinomial")


TRACKERS = {
    "partitioned": partitioned,
    "pffl": lambda: jaxpf.PFFL(**MODEL),
    "eskil": lambda: jaxpf.Eskil(**MODEL),
    "labelled": lambda: jaxpf.Labelled(**MODEL),
    "open": lambda: jaxpf.Labelled(**MODEL, population="open"),
    "error bars": lambda: WithErrorBars(partitioned(), lag=2),
    "side by side": lambda: SideBySide(WithErrorBars(partitioned()), 2),
}


def whole_run(its, frames=FRAMES):
    """States after every frame, and summaries."""
    return jaxpf.run(its, KEY, frames, everything)[1]


def at(time, tree):
    return jax.tree.map(lambda x: x[time], tree)


@pytest.mark.parametrize(
    "kind",
    [pytest.param(x, marks=[pytest.mark.slow] * (x != "partitioned")) for x in TRACKERS],
)
def test_a_resumed_run_is_the_uninterrupted_one_bit_for_bit(kind, tmp_path):
    its = TRACKERS[kind]()
    states, summaries = whole_run(its)
    assert list(states.time) == [1, 2, 3, 4]
    assert states.time.dtype == jnp.int32
    jaxpf.save(tmp_path / "half.npz", at(1, states))
    loaded = jaxpf.load(tmp_path / "half.npz", its)
    end, rest = jaxpf.run(its, KEY, FRAMES[2:], state=loaded)
    assert_equal(end, at(-1, states))
    assert_equal(rest, at(slice(2, None), summaries))


@pytest.mark.slow
def test_streams_and_runs_at_different_times_resume_at_the_time_of_their_state():
    its, frames = walk(num_particles=6), FRAMES[:, 0, 0]
    states, _ = whole_run(its, frames)
    streamed = list(jaxpf.stream(its, KEY, frames[2:], state=at(1, states)))
    assert [one.time for one in streamed] == [2, 3]
    np.testing.assert_allclose(streamed[-1].state.lagged, at(-1, states).lagged, rtol=1e-6)
    both = at(slice(1, 3), states)
    later = jax.vmap(lambda state: jaxpf.forecast(its, KEY, state, 2)[0])(both)
    assert list(later.time) == [4, 5]
    alone = jaxpf.forecast(its, KEY, at(2, states), 2)[0]
    np.testing.assert_allclose(later.lagged[1], alone.lagged, rtol=1e-6)


@pytest.mark.statistical
def test_a_random_walk_resumed_after_every_frame_spreads_as_it_should():
    its = walk(num_particles=20_000)
    state, _ = jaxpf.forecast(its, KEY, its.init(KEY), 1)
    _, after = jaxpf.forecast(its, KEY, state, 1)
    error = 2**0.5 / (2 * its.num_particles) ** 0.5
    assert abs(after.spread[0, 0, 0] - 2**0.5) / error < LIMIT


@pytest.mark.statistical
def test_the_evidence_of_a_run_resumed_after_every_frame_is_unbiased():
    its, frames = walk(num_particles=8), np.array([1.5, -1.0], np.float32)
    one = np.eye(1)
    exact = kalman(one, one, one, one, np.zeros(1), 0 * one, frames[:, None])[0]

    @jax.jit
    @jax.vmap
    def evidence(key):
        state, first = jaxpf.run(its, key, frames[:1])
        _, second = jaxpf.run(its, key, frames[1:], state=state)
        return jnp.exp(first.log_evidence[0] + second.log_evidence[0] - np.sum(exact))

    ratio = evidence(jax.random.split(KEY, 20_000))
    assert abs(np.mean(ratio) - 1) / (np.std(ratio) / len(ratio) ** 0.5) < LIMIT


class Timed(NamedTuple):
    """State of a user's tracker."""

    value: Any
    time: Any


@jaxpf.pytree_dataclass
class Own:
    """A user's tracker: its state is noise, with or without its time."""

    says_time: bool = jaxpf.contract.static_field(default=False)

    def init(self, key):
        return Timed(jnp.zeros(()), jnp.int32(0)) if self.says_time else jnp.zeros(())

    def step(self, key, state, frame):
        noise = jax.random.normal(key)
        return (Timed(noise, state.time + 1) if self.says_time else noise), noise


def test_a_users_state_resumes_if_it_says_its_time_and_is_refused_otherwise():
    its = Own(says_time=True)
    _, whole = jaxpf.run(its, KEY, FRAMES)
    half, first = jaxpf.run(its, KEY, FRAMES[:2])
    assert_equal(jnp.append(first, jaxpf.run(its, KEY, FRAMES[2:], state=half)[1]), whole)
    state, untimed = jaxpf.run(Own(), KEY, FRAMES)
    assert_equal(untimed, whole)
    for go_on in (
        lambda: jaxpf.run(Own(), KEY, FRAMES, state=state),
        lambda: next(jaxpf.stream(Own(), KEY, FRAMES, state=state)),
    ):
        with pytest.raises(InputError, match="has no field time, so resuming would repeat the ra"):
            go_on()
