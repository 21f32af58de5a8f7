"""The order that pilot runs choose."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import InputError, ordering
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian
from jaxpf.tuning import best_order, candidate_orders

#: Of the observations: who is seen sharply should be searched first.
NOISE = np.array([3.0, 1.0, 0.3, 0.05])
SHARP_FIRST, SHARP_LAST = (3, 2, 1, 0), (0, 1, 2, 3)
FRAMES = np.random.default_rng(0).normal(size=(10, 4, 1)).cumsum(axis=0).astype(np.float32)


def tracker(**changes):
    settings = {
        "dynamics": RandomWalk(1.0),
        "likelihood": Gaussian(noise=jnp.asarray(NOISE[:, None, None], jnp.float32)),
        "ordering": ordering.sir(4),
        "initial": jnp.zeros((4, 1)),
        "num_particles": 100,
    }
    return jaxpf.Partitioned(**(settings | changes))


def test_the_better_order_comes_first():
    """By more than chance: some twice the variance."""
    many = best_order(tracker(), jax.random.key(1), FRAMES, [SHARP_LAST, SHARP_FIRST], 400)
    assert many.orders == [SHARP_FIRST, SHARP_LAST]
    assert np.diff(many.variance) / np.hypot(*many.standard_error) > 4.5


def test_the_best_order_is_measured_again():
    """Of twelve alike the smallest of the first runs is too small, and the fresh runs are not."""
    alike = tracker(likelihood=Gaussian(noise=jnp.ones((4, 1, 1), jnp.float32)))
    pilots = [best_order(alike, jax.random.key(seed), FRAMES[:3], num_runs=4) for seed in range(40)]
    best, rest = (
        np.array([np.mean(pilot.variance[which]) for pilot in pilots])
        for which in (slice(0, 1), slice(1, None))
    )
    # A pilot's own runs put the best far below all others; fresh runs know nothing of that.
    error = best.std(ddof=1) / np.sqrt(len(best))
    assert best.mean() > rest.mean() - 4.5 * error
    smallest = np.mean([pilot.variance[1:].min() for pilot in pilots])
    assert best.mean() > smallest


@pytest.mark.slow
def test_a_pilot_tells_its_own_error():
    many = best_order(tracker(), jax.random.key(1), FRAMES, [SHARP_FIRST], 400)
    few = [
        best_order(tracker(), jax.random.key(2 + seed), FRAMES, [SHARP_FIRST], 40)
        for seed in range(30)
    ]
    told = np.array([pilot.standard_error[0] for pilot in few])
    variance = np.array([pilot.variance[0] for pilot in few])
    error = np.hypot(variance.std(ddof=1) / 30**0.5, many.standard_error[0])
    assert abs(variance.mean() - many.variance[0]) < 4.5 * error
    # What a pilot tells of its error is how much pilots differ, which 30 of them know to 13 %.
    assert abs(variance.std(ddof=1) / np.sqrt(np.mean(told**2)) - 1) < 4.5 * 0.13


def test_candidates_are_shifts_and_others_each_once_with_parents_first():
    objects = candidate_orders((-1,) * 5)
    assert objects[:2] == [(0, 1, 2, 3, 4), (1, 2, 3, 4, 0)]
    assert len(set(objects)) == len(objects) == 12
    assert candidate_orders((-1, -1)) == [(0, 1), (1, 0)]
    tree = (-1, 0, 0, 1)
    admissible = {
        order
        for order in itertools.permutations(range(4))
        if all(tree[p] < 0 or order.index(tree[p]) < order.index(p) for p in range(4))
    }
    assert set(candidate_orders(tree)) == admissible


def test_who_has_no_order_is_refused():
    one = tracker(
        likelihood=Gaussian(noise=jnp.ones((1, 1, 1))),
        ordering=ordering.sir(1),
        initial=jnp.zeros((1, 1)),
    )
    labelled = tracker(ordering=ordering.branched([[0, 1, 2, 3]]))
    factored = jaxpf.PFFL(RandomWalk(1.0), tracker().likelihood, initial=jnp.zeros((4, 1)))
    for its in (one, labelled, factored):
        with pytest.raises(InputError, match="use method ps on at least two"):
            best_order(its, jax.random.key(0), FRAMES)
    with pytest.raises(InputError, match="num_runs=1 says nothing"):
        best_order(tracker(), jax.random.key(0), FRAMES, num_runs=1)
