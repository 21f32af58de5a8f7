"""The random numbers are JAX's own, whichever way the generator is compiled."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf.lowering.threefry import written_out

DRAWS = {
    "normal": lambda key: jax.random.normal(key, (3, 70)),
    "uniform of one": lambda key: jax.random.uniform(key),
    "uniform of none": lambda key: jax.random.uniform(key, (0,)),
    "whole numbers": lambda key: jax.random.randint(key, (9,), 0, 1000),
    "bytes": lambda key: jax.random.bits(key, (33,), "uint8"),
    "permutation": lambda key: jax.random.permutation(key, 100),
    # A loop of arithmetic: its last bits are the same only as users compile it.
    "gamma": jax.jit(
        lambda key: jax.random.gamma(key, 2.0, (50,)),
        compiler_options={
            "xla_backend_optimization_level": 3,
            "xla_llvm_disable_expensive_passes": False,
        },
    ),
    "fold_in": lambda key: jax.random.normal(jax.random.fold_in(key, 3), (5,)),
    "few keys": lambda key: jax.vmap(jax.random.normal)(jax.random.split(key, 3)),
    "many keys": lambda key: jax.vmap(jax.random.normal)(jax.random.split(key, (4, 50)).ravel()),
}


@pytest.mark.parametrize("x64", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "draw",
    [
        pytest.param(draw, id=name, marks=[pytest.mark.slow] * (name == "gamma"))
        for name, draw in DRAWS.items()
    ],
)
def test_draws_are_those_of_jax_bit_for_bit(draw, x64):
    with jax.enable_x64(x64):
        key = jax.random.key(7)
        expected, drawn = draw(key), draw(written_out(key))
    assert drawn.dtype == expected.dtype
    np.testing.assert_array_equal(drawn, expected)


@pytest.mark.parametrize("x64", [False, True])
def test_twenty_rounds_fuse_with_nothing_that_uses_them(x64):
    with jax.enable_x64(x64):
        drawn = jax.jit(lambda key: jax.random.normal(written_out(key), (8,)))
        assert "optimization_barrier" in drawn.lower(jax.random.key(0)).as_text()


def test_draws_are_the_same_for_a_batch_of_keys():
    keys = jax.random.split(jax.random.key(0), 5)

    def draw(key):
        return jax.random.normal(written_out(key), (7,))

    together = jax.jit(jax.vmap(draw))(keys)
    np.testing.assert_array_equal(together, jnp.stack([draw(key) for key in keys]))
    np.testing.assert_array_equal(
        together, jax.vmap(lambda key: jax.random.normal(key, (7,)))(keys)
    )


def test_other_kinds_of_keys_are_left_alone():
    for kind in ("rbg", "unsafe_rbg"):
        key = jax.random.key(0, impl=kind)
        assert written_out(key) is key
    changed = written_out(jax.random.key(0))
    assert written_out(changed) is changed


def test_a_setting_that_numbers_draws_in_another_way_is_respected():
    with jax.threefry_partitionable(False):
        key = jax.random.key(0)
        assert written_out(key) is key


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="a GPU draws with JAX's own generator")
def test_too_many_numbers_at_once_are_refused():
    key = written_out(jax.random.key(0))
    with pytest.raises(NotImplementedError, match="fewer than 2\\^32"):
        jax.jit(lambda: jax.random.bits(key, (2**16, 2**16))).lower()


@pytest.mark.slow
def test_models_may_draw_from_a_poisson_law_which_takes_keys_of_jax_alone():
    def model(draw):
        return jaxpf.state_space(
            initial=lambda key, p: draw(key, 3.0),
            transition=lambda key, x, p: x + draw(key, 1.0),
            log_likelihood=lambda y, x, p: -((y - x) ** 2),
            num_particles=20,
        )

    def with_a_key_of_jax(key, rate):
        return jax.random.poisson(jax.random.wrap_key_data(jax.random.key_data(key)), rate)

    run = [
        jaxpf.run(model(draw), jax.random.key(0), np.ones(3))[1].estimate
        for draw in (jax.random.poisson, with_a_key_of_jax)
    ]
    np.testing.assert_array_equal(*run)
