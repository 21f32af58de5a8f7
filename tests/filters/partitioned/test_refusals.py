"""Dtypes that stay, and what is refused naming the value."""

import jax
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from tagged_walk import METHODS, D, P, frames, tracker

from jaxpf import InputError, ordering
from jaxpf.dynamics import IndependentGaussian

# Dtypes.


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


# Refusals.


def correlated():
    return CorrelatedGaussian(covariance=np.eye(3, dtype=np.float32))


def joint_sampler(key):
    return jax.random.normal(key, (P, D))


@pytest.mark.parametrize(
    ("order", "settings", "sentence"),
    [
        (lambda: [0, 1, 2], {}, r"ordering=\[0, 1, 2\] is not an ordering; make one by"),
        (lambda: ordering.sir(3), {"resampling": "bootstrap"}, r"resampling='bootstrap'"),
        (lambda: ordering.sir(3), {"parents": (-1, 0)}, r"parents has 2 parts .* ordering has 3"),
        (lambda: ordering.sir(3), {"parents": (-1, 0, 7)}, r"parents\[2\]=7 is not a part"),
        (lambda: ordering.sir(3), {"initial": np.zeros(3)}, r"initial has shape \(3,\).*P = 3"),
        (lambda: ordering.sir(3), {"initial": np.zeros((2, 1))}, r"initial has shape \(2, 1\)"),
        (lambda: ordering.dps(3), {"num_particles": 2}, r"num_particles=2 is fewer than the 3"),
        (
            lambda: ordering.sir(3),
            {"num_particles": 0},
            r"num_particles = 0 must be a whole",
        ),
        (
            lambda: ordering.ps([1, 0, 2]),
            {"parents": (-1, 0, 0)},
            r"order \[1, 0, 2\] puts part 1 before its parent 0",
        ),
        (
            lambda: ordering.dps(3),
            {"parents": (-1, 0, 0)},
            r"order \[1, 2, 0\] puts part 1 before its parent 0",
        ),
        (
            lambda: ordering.sps(num_partitions=3),
            {"likelihood": "correlated"},
            r"swap='combinatorial' .* log_joint",
        ),
        (
            lambda: ordering.sps(num_partitions=3, swap="sorted"),
            {"tempering": 0.5},
            r"swap='sorted' needs equal weights, and tempering=0\.5",
        ),
        (
            lambda: ordering.sps([-1, 0, 0]),
            {"parents": (-1, 0, 1)},
            r"part tree \[-1, 0, 0\] is unlike the model's \[-1, 0, 1\]",
        ),
        (
            lambda: ordering.sps(num_partitions=3),
            {"initial": jax.tree_util.Partial(joint_sampler)},
            r"swap='combinatorial' exchanges roots, but the initial sampler",
        ),
    ],
)
def test_what_cannot_work_is_refused_naming_the_value(order, settings, sentence):
    if settings.get("likelihood") == "correlated":
        settings = settings | {"likelihood": correlated()}
    with pytest.raises(InputError, match=sentence):
        tracker(order(), **settings)


def test_what_is_refused_with_an_exchange_is_fine_without():
    alone = ordering.sps(num_partitions=3, swap="none")
    tracker(alone, likelihood=correlated())
    tracker(alone, tempering=0.5)
    sampler = jax.tree_util.Partial(joint_sampler)
    tracker(ordering.sps(num_partitions=3, exchange_roots=False), initial=sampler)
    tracker(ordering.sps([-1, 0, 0]), parents=(-1, 0, 0), initial=sampler)


def test_a_sampler_of_another_shape_is_noticed():
    made = tracker(ordering.sir(P), initial=IndependentGaussian(np.zeros((2, D)), 1.0))
    with pytest.raises(AssertionError):
        made.init(jax.random.key(0))
