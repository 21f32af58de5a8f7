"""What pytrees print as, and what a constructor or a run says of wrong names and orders."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import partitioned

import jaxpf
from jaxpf import InputError
from jaxpf.dynamics import RandomWalk


def tracker():
    return partitioned(dynamics=RandomWalk(scale=jnp.ones(1)), num_particles=40)


def test_trackers_states_and_summaries_print_as_a_few_lines():
    state, summaries = jaxpf.run(tracker(), jax.random.key(0), np.zeros((5, 2, 1)))
    for value in (tracker(), state, summaries):
        text = repr(value)
        assert text.startswith(type(value).__name__)
        assert len(text.splitlines()) < 15
        assert max(map(len, text.splitlines())) <= 100
    assert "num_particles=40" in repr(tracker())
    assert "log_weights=f32[40] " in repr(state)
    last = jax.tree.map(lambda x: x[-1], summaries)
    assert f"log_evidence=f32[] {int(last.log_evidence)}." in repr(last)
    assert "spread=f32[5, 2, 1] 0." in repr(summaries)
    assert "label_probabilities" not in repr(summaries)  # there are none


def test_tracers_print_as_shapes():
    texts = []

    @jax.jit
    def step(tracker, key, frame):
        state = tracker.init(key)
        texts.extend([repr(tracker), repr(state), repr(tracker.step(key, state, frame)[1])])
        return state

    step(tracker(), jax.random.key(0), np.zeros((2, 1)))
    assert "initial=f32[2, 1]," in texts[0]
    assert "log_weights=f32[40],\n" in texts[1]
    assert "log_evidence=f32[],\n" in texts[2]


@jaxpf.pytree_dataclass
class Box:
    value: object


def test_big_deleted_and_odd_arrays_print_too():
    class Unreadable(np.ndarray):
        def __array_finalize__(self, other):
            pass

        def __getitem__(self, place):
            raise AssertionError("a big array was read")

    big = np.zeros(20_000, np.float32).view(Unreadable)
    assert repr(Box(big)) == "Box(value=f32[20000])"
    deleted = jnp.zeros(3)
    deleted.delete()
    assert repr(Box(deleted)) == "Box(value=f32[3])"
    assert repr(Box(np.array([np.nan] * 9))) == "Box(value=f64[9] nan)"
    assert repr(Box(np.array([np.nan, 1, 4] * 9))) == "Box(value=f64[27] 1..4)"
    assert repr(Box(np.zeros((0, 3)))) == "Box(value=f64[0, 3])"
    assert repr(Box(jax.random.key(0))) == "Box(value=key<fry>[])"
    assert repr(Box(jax.ShapeDtypeStruct((2,), np.float32))) == "Box(value=f32[2])"
    assert repr(Box({"a": (1.5,), "b": [np.sin]})) == "Box(value={'a': (1.5,), 'b': [sin]})"
    assert repr(Box(Box(None))) == "Box(value=Box())"
    assert repr(Box("x" * 500)).endswith(" ...,\n)")


def test_a_misspelt_field_or_name_is_refused_with_the_right_one():
    with pytest.raises(InputError, match="Partitioned has no field 'dynamcs'; did you mean dyn"):
        jaxpf.Partitioned(dynamcs=None)
    with pytest.raises(InputError, match="RandomWalk has no field 'zzz'; there are scale"):
        RandomWalk(zzz=1)
    with pytest.raises(AttributeError, match="'trackr'; did you mean 'tracker'"):
        jaxpf.boxes.trackr  # noqa: B018
    assert list(inspect.signature(RandomWalk).parameters) == ["scale"]
