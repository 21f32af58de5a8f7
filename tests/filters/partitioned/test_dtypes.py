"""Dtypes and shapes that stay."""

import jax
import numpy as np
import pytest
from tagged_walk import METHODS, D, P, frames, tracker

from jaxpf import ordering


def dtypes(made, observed):
    state = jax.eval_shape(made.init, jax.random.key(0))
    after, summary = jax.eval_shape(made.step, jax.random.key(0), state, observed)
    assert jax.tree.structure(state) == jax.tree.structure(after)
    before, behind = ([(x.shape, x.dtype) for x in jax.tree.leaves(t)] for t in (state, after))
    assert before == behind
    assert after.lineage.dtype == after.component.dtype == np.int32
    assert summary.status.dtype == summary.num_invalid.dtype == np.int32
    reported = summary.estimate, summary.log_evidence, summary.ess, summary.spread
    floats = {x.dtype for x in (after.lagged, after.log_weights, *reported)}
    assert len(floats) == 1
    return floats.pop()


@pytest.mark.parametrize(
    "method",
    [
        name if name in ("sir", "sps-combinatorial") else pytest.param(name, marks=pytest.mark.slow)
        for name in METHODS
    ],
)
def test_float32_stays_float32_and_float64_stays_float64(method):
    assert dtypes(tracker(METHODS[method]()), frames()[0]) == np.float32
    with jax.enable_x64(True):
        # float32 models under float64 keep to the state's dtype.
        assert dtypes(tracker(METHODS[method]()), frames()[0]) == np.float32
        wide = tracker(METHODS[method](), initial=np.zeros((P, D), np.float64))
        assert dtypes(wide, frames()[0]) == np.float64


def test_whole_numbers_as_initial_state_become_floats():
    made = tracker(ordering.sir(P), initial=[[1, 2], [3, 4], [5, 6]])
    assert made.initial.dtype == np.float32
    state = made.init(jax.random.key(0))
    np.testing.assert_array_equal(state.substates[7], [[1, 2], [3, 4], [5, 6]])
