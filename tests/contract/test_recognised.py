"""Functions made anew at each call are recognised, and their programs used again."""

import functools
import gc
import weakref

import jax
import jax.numpy as jnp
import numpy as np
from models import Adding

import jaxpf
from jaxpf.contract.recognised import recognised

FACTOR = 1


@jaxpf.pytree_dataclass
class Traced(Adding):
    """Counts how often it is traced."""

    def step(self, key, state, frame):
        traced.append(0)
        return super().step(key, state, frame)


traced: list[int] = []


def run(record):
    return jaxpf.run(Traced(), jax.random.key(0), np.ones(3, np.float32), record)[1]


def made(values, attribute=0):
    """A function that reads values, and whose attribute is set."""

    def function(state, summary, default=values):
        return jnp.sum(summary) * helper(values), default

    def helper(x):
        return FACTOR * x

    function.attribute = attribute
    return function


def test_a_lambda_in_a_loop_compiles_once():
    for _ in range(4):
        found = run(lambda state, summary: 2 * summary)
        traced.append(0)
    assert len(traced) == 4 + traces_of_a_program()
    np.testing.assert_array_equal(found, [0.0, 2.0, 4.0])


def traces_of_a_program():
    before = len(traced)
    run(lambda state, summary: 3 * summary)
    count = len(traced) - before
    del traced[before:]
    return count


VALUES = [1, 1.0, True, -0.0, 0.0, "a", (1,), (1.0,), np.ones(2), np.ones(2, int), np.ones((2, 1))]


def test_only_equal_values_are_recognised():
    functions = [recognised(made(value)) for value in VALUES]
    assert len(set(map(id, functions))) == len(VALUES)
    for value, function in zip(VALUES, functions, strict=True):
        assert recognised(made(value)) is function
    assert recognised(made(1, attribute=1)) is not functions[0]
    array = jnp.ones(3)
    assert recognised(made(array)) is recognised(made(array))
    assert recognised(made(array)) is not recognised(made(jnp.ones(3)))
    partial = functools.partial(made(1), default=2)
    assert recognised(partial) is partial


def test_a_changed_global_is_noticed(monkeypatch):
    first = recognised(made(7))
    monkeypatch.setitem(globals(), "FACTOR", 2)
    again = made(7)
    assert recognised(again) is again
    assert recognised(made(7)) is again is not first
    values = np.zeros(2)
    function = recognised(made(values))
    values[0] = 5
    assert recognised(function) is function
    changed = made(values)
    assert recognised(changed) is changed  # not the function compiled with zeros


def test_what_nobody_keeps_is_forgotten():
    arrays = [jnp.full(3, float(k)) for k in range(10)]
    kept = [weakref.ref(array) for array in arrays]
    functions = [recognised(made(array)) for array in arrays]
    assert len(set(map(id, functions))) == 10
    del arrays, functions
    gc.collect()
    assert not [ref for ref in kept if ref() is not None]


def test_state_space_models_of_equal_lambdas_share_a_program():
    def build():
        return jaxpf.state_space(
            initial=lambda key, p: jax.random.normal(key),
            transition=lambda key, x, p: x + jax.random.normal(key),
            log_likelihood=lambda y, x, p: -((y - x) ** 2),
        )

    assert jax.tree.structure(build()) == jax.tree.structure(build())


def test_traced_values_are_never_kept():
    def traced_one(x):
        function = made(x)
        assert recognised(function) is function
        return x

    jax.jit(traced_one)(1.0)
