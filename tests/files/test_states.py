"""A filter's state, saved and gone on with."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import InputError, ordering
from jaxpf.dynamics import RandomWalk
from jaxpf.filters import SideBySide
from jaxpf.likelihoods import Gaussian

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
def whole():
    """States and summaries of a run."""
    return jax.device_get(jaxpf.run(one(), jax.random.key(1), FRAMES, lambda *both: both)[1])


@pytest.fixture(scope="module")
def saved(tmp_path_factory, whole):
    path = tmp_path_factory.mktemp("state") / "after.npz"
    jaxpf.save(path, jax.tree.map(lambda x: x[2], whole[0]))
    return path


def test_a_run_goes_on_as_if_nothing_had_been_between(saved, whole):
    state = jaxpf.load(saved, one())
    end, rest = jaxpf.run(one(), jax.random.key(1), FRAMES[3:], state=state)
    states_after, summaries = whole
    assert jnp.array_equal(rest.estimate, summaries.estimate[3:])
    assert jnp.array_equal(end.lagged, states_after.lagged[-1])


@pytest.mark.parametrize(
    ("tracker", "said"),
    [
        (one(30), "as many particles and objects as were saved"),
        (one(20, 3), "as many particles and objects as were saved"),
        (SideBySide(one(), 2), "another kind of tracker than SideBySide"),
    ],
)
def test_the_state_of_another_tracker_is_refused(saved, tracker, said):
    with pytest.raises(InputError, match=said):
        jaxpf.load(saved, tracker)


def test_what_is_no_state_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    for content, said in ((b"nothing", "holds no state"), (b"", "holds no state")):
        path.write_bytes(content)
        with pytest.raises(InputError, match=said):
            jaxpf.load(path, one())
    with pytest.raises(InputError, match="check the path"):
        jaxpf.load(tmp_path / "none.npz", one())
    with pytest.raises(InputError, match="tracker is None; give a tracker"):
        jaxpf.load(path, None)
    for none in (None, object(), {"a": "b"}):
        with pytest.raises(InputError, match=r"state=.* holds no arrays"):
            jaxpf.save(path, none)
    for other in (1, 99):  # files of format 1 do not say when the state was
        np.savez(path, format=other)
        with pytest.raises(InputError, match=f"saved in format {other}, and this version reads 2"):
            jaxpf.load(path, one())
    for damaged in ({"format": np.array([{}], object)}, {"format": "x"}, {"time": 1}):
        np.savez(path, **damaged)
        with pytest.raises(InputError, match="holds no state"):
            jaxpf.load(path, one())


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
    [
        (jnp.float32(3), "has the time Array.3., dtype=float32"),
        (jnp.full(2, 3), r"has the time Array.\[3, 3\]"),
    ],
)
def test_a_state_that_does_not_say_its_time_is_refused(saved, time, said):
    """It chooses a frame's random numbers."""
    state, key = jaxpf.load(saved, one()), jax.random.key(1)
    state = dataclasses.replace(state, time=time)
    for go_on in (
        lambda: jaxpf.run(one(), key, FRAMES[3:], state=state),
        lambda: jaxpf.forecast(one(), key, state, 1),
        lambda: next(jaxpf.stream(one(), key, iter(FRAMES[3:]), state=state)),
    ):
        with pytest.raises(InputError, match=f"{said}.*; let the state hold time"):
            go_on()


@pytest.mark.parametrize("steps", [0, 2.5, "a", None])
def test_a_forecast_of_no_number_of_frames_is_refused(saved, steps):
    state = jaxpf.load(saved, one())
    with pytest.raises(InputError, match=f"steps = {steps!r} must be a whole number from 1"):
        jaxpf.forecast(one(), jax.random.key(1), state, steps)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (one(num_particles=21), "and the tracker 21 of 2"),
        (one(num_objects=3), "the tracker 20 of 3"),
    ],
)
def test_going_on_from_the_state_of_another_tracker_is_refused(saved, other, words):
    state, key = jaxpf.load(saved, one()), jax.random.key(1)
    frames = FRAMES[:, [0] * other.num_partitions]
    with pytest.raises(InputError, match=f"has 20 particles of 2 partition.*{words}"):
        jaxpf.run(other, key, frames, state=state)


def test_a_file_without_a_name_is_refused(saved):
    with pytest.raises(InputError, match="is not a path; give the name"):
        jaxpf.save("", jaxpf.load(saved, one()))


def test_a_state_of_another_precision_is_refused_with_its_own_remedy(saved):
    with (
        jax.enable_x64(True),
        pytest.raises(InputError, match=r"is float32 .* and this one's float64 .*jax_enable_x64"),
    ):
        jaxpf.load(saved, one())
