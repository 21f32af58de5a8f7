"""A filter's state, saved and gone on with."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import message_of

import jaxpf
from jaxpf import ordering
from jaxpf.dynamics import RandomWalk
from jaxpf.filters import SideBySide
from jaxpf.likelihoods import Gaussian

KEY = jax.random.key(1)
FRAMES = np.random.default_rng(0).normal(size=(6, 2, 1)).astype(np.float32)


def one(num_particles=20, num_objects=2):
    return jaxpf.Partitioned(
        dynamics=RandomWalk(1.0),
        likelihood=Gaussian(noise=jnp.ones((num_objects, 1, 1))),
        ordering=ordering.ps(range(num_objects)),
        initial=jnp.zeros((num_objects, 1)),
        num_particles=num_particles,
    )


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The state after three frames, see ``tests/running/test_resuming.py`` for what follows."""
    path = tmp_path_factory.mktemp("state") / "after.npz"
    jaxpf.save(path, jaxpf.run(one(), KEY, FRAMES[:3])[0])
    return path


@pytest.mark.parametrize(
    ("tracker", "said"),
    [
        (one(30), "as many particles and objects as were saved"),
        (one(20, 3), "as many particles and objects as were saved"),
        (SideBySide(one(), 2), "another kind of tracker than SideBySide"),
    ],
)
def test_the_state_of_another_tracker_is_refused(saved, tracker, said):
    assert said in message_of(jaxpf.load, saved, tracker)


def test_what_is_no_state_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    for content in (b"nothing", b""):
        path.write_bytes(content)
        assert "holds no state" in message_of(jaxpf.load, path, one())
    assert "check the path" in message_of(jaxpf.load, tmp_path / "none.npz", one())
    assert "tracker is None; give a tracker" in message_of(jaxpf.load, path, None)
    for none in (None, object(), {"a": "b"}):
        assert "holds no arrays" in message_of(jaxpf.save, path, none)
    for other in (1, 99):  # files of format 1 do not say when the state was
        np.savez(path, format=other)
        assert f"in format {other}, and this version reads 2" in message_of(jaxpf.load, path, one())
    for damaged in ({"format": np.array([{}], object)}, {"format": "x"}, {"time": 1}):
        np.savez(path, **damaged)
        assert "holds no state" in message_of(jaxpf.load, path, one())


@jaxpf.pytree_dataclass
class Counting:
    """A tracker whose state is a random key and a number."""

    def init(self, key):
        return key, jnp.zeros(())


def test_random_keys_are_kept(tmp_path):
    key, path = jax.random.key(7), tmp_path / "keys.npz"
    jaxpf.save(path, (key, jnp.ones(())))
    loaded, number = jaxpf.load(path, Counting())
    assert jax.random.uniform(loaded) == jax.random.uniform(key)
    assert number == 1


@pytest.mark.parametrize(
    ("time", "said"),
    [(jnp.float32(3), "dtype=float32"), (jnp.full(2, 3), "has the time Array([3, 3]")],
)
def test_a_state_that_does_not_say_its_time_is_refused(saved, time, said):
    """It chooses a frame's random numbers."""
    state = dataclasses.replace(jaxpf.load(saved, one()), time=time)
    for go_on in (
        lambda: jaxpf.run(one(), KEY, FRAMES[3:], state=state),
        lambda: jaxpf.forecast(one(), KEY, state, 1),
        lambda: next(jaxpf.stream(one(), KEY, iter(FRAMES[3:]), state=state)),
    ):
        message = message_of(go_on)
        assert said in message
        assert "let the state hold time" in message


@pytest.mark.parametrize("steps", [0, 2.5, "a", None])
def test_a_forecast_of_no_number_of_frames_is_refused(saved, steps):
    message = message_of(jaxpf.forecast, one(), KEY, jaxpf.load(saved, one()), steps)
    assert f"steps = {steps!r} must be a whole number from 1" in message


@pytest.mark.parametrize(("other", "words"), [(one(21), "21 of 2"), (one(20, 3), "20 of 3")])
def test_going_on_from_the_state_of_another_tracker_is_refused(saved, other, words):
    frames = FRAMES[:, [0] * other.num_partitions]
    message = message_of(jaxpf.run, other, KEY, frames, state=jaxpf.load(saved, one()))
    assert "has 20 particles of 2 partition" in message
    assert words in message


def test_a_file_without_a_name_is_refused(saved):
    assert "is not a path; give the name" in message_of(jaxpf.save, "", jaxpf.load(saved, one()))


def test_a_state_of_another_precision_is_refused_with_its_own_remedy(saved):
    with jax.enable_x64(True):
        assert "jax_enable_x64" in message_of(jaxpf.load, saved, one())
