"""One edge pays once: which density the lines of several targets have, by summation."""

from functools import partial
from itertools import pairwise, permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.likelihoods import (
    Features,
    detection_probabilities,
    line_weights,
    poisson_clutter,
)
from jaxpf.likelihoods.contours.line_model import log_ratios
from jaxpf.likelihoods.contours.share import log_mean_of, log_means
from jaxpf.likelihoods.contours.union import mean_over_orders, sets_before

# One program each, in place of one for every operation.
log_ratios = jax.jit(log_ratios, static_argnums=6)
mean_over_orders = jax.jit(mean_over_orders)
log_means = jax.jit(log_means, static_argnums=5)
LENGTH, REACH, SIGMA, MOST = 41.0, 20.5, 4.0, 3
CLUTTER = np.array([0.3, 0.3, 0.2, 0.2])
POINTS, SHARES = np.polynomial.legendre.leggauss(32)


@pytest.fixture(autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


def every_line():
    """All that a line can show: places and presence ``[3, n, z]``, ``p_0`` of them ``[n, z]``."""
    grid = np.stack(np.meshgrid(*[POINTS * REACH] * MOST, indexing="ij")).reshape(MOST, 1, -1)
    share = np.prod(np.meshgrid(*[SHARES / 2] * MOST, indexing="ij"), axis=0).ravel()
    present = np.arange(MOST)[:, None, None] < np.arange(MOST + 1)[:, None]
    places = np.broadcast_to(grid, (MOST, MOST + 1, grid.shape[-1]))
    return Features(places, np.broadcast_to(present, places.shape)), CLUTTER[:, None] * share


def ratios(boundaries, groups):
    """``log(p~ / p_0)`` of every line ``[n, z]``, crossed by these groups of boundaries."""
    features, _ = every_line()
    nu = np.reshape(boundaries, (-1, 1, 1)) * np.ones(features.places.shape[1:])
    weights = line_weights(CLUTTER, detection_probabilities(len(boundaries)), LENGTH)
    there = np.ones(nu.shape, bool)
    groups = tuple(map(tuple, groups))
    return [np.asarray(r) for r in log_ratios(weights, features, nu, there, SIGMA, REACH, groups)]


def of_sets(boundaries):
    """``log(p~(z | S) / p_0(z))`` ``[S, n, z]``: each target crosses the line once."""
    count = len(boundaries)
    sets = [[j for j in range(count) if members >> j & 1] for members in range(2**count)]
    return np.stack([np.broadcast_to(r, every_line()[1].shape) for r in ratios(boundaries, sets)])


@pytest.mark.parametrize("num_targets", [1, 2, 3, 4])
def test_the_mean_over_orders_is_that_of_all_orders_of_few_targets(num_targets):
    """Of four targets, eight of the 24 orders, in which each has every place as often."""
    rng, found = np.random.default_rng(0), {}

    def factor(target, before):
        return found.setdefault((target, frozenset(before)), rng.normal())

    factors = [
        jnp.array(
            [factor(j, [(j + step) % num_targets for step in before]) for j in range(num_targets)]
        )
        for before in sets_before(num_targets)
    ]
    everyone = range(num_targets)
    orders = [
        order
        for order in permutations(everyone)
        if len({(b - a) % num_targets for a, b in pairwise(order)}) <= 1
        and all((b - a) % num_targets in (1, num_targets - 1) for a, b in pairwise(order))
    ]
    assert len(orders) == (1, 2, 6, 8)[num_targets - 1]
    products = [
        np.exp(sum(factor(target, order[:place]) for place, target in enumerate(order)))
        for order in orders
    ]
    assert float(mean_over_orders(factors)) == pytest.approx(np.log(np.mean(products)))
    for place in everyone:
        taken = [order[place] for order in orders]
        assert {taken.count(target) for target in everyone} == {len(orders) // num_targets}


@pytest.mark.parametrize("boundaries", [(0.0, 3.0), (0.0, 0.0, 6.0)])
def test_targets_whose_lines_are_one_line_have_the_density_of_that_line(boundaries):
    """The extreme: every target's line is the same, and shows one edge to all of them."""
    found = of_sets(boundaries)
    count, (_, clutter) = len(boundaries), every_line()
    factors = []
    for before in sets_before(count):
        sets = [sum(1 << (target + step) % count for step in before) for target in range(count)]
        factors.append(np.stack([found[s | 1 << j] - found[s] for j, s in enumerate(sets)]))
    joint = np.asarray(mean_over_orders([jnp.asarray(factor) for factor in factors]))
    np.testing.assert_allclose(joint, found[-1], atol=1e-9)
    assert np.sum(clutter * np.exp(joint)) == pytest.approx(1, abs=1e-6)
    # Eq. 2 and 5 as printed multiply over all targets' lines: one edge is paid by each.
    literal = count * found[-1]
    assert np.sum(clutter * np.exp(literal)) > 1.5


def test_three_targets_have_one_evidence_under_every_order_in_depth():
    """Each body lies left of its boundary, and hides what is there of those behind it."""
    _, clutter = every_line()
    for places in ((-8.0, 0.0, 4.0), (3.0, 3.5, -1.0)):
        found, evidence = of_sets(places), 0.0
        of_label = []
        for order in permutations(range(3)):
            shown = sum(
                1 << target
                for depth, target in enumerate(order)
                if all(places[nearer] < places[target] for nearer in order[:depth])
            )
            factors = []
            for before in sets_before(3):
                sets = [sum(1 << (j + step) % 3 for step in before) & shown for j in range(3)]
                factors.append(
                    np.stack([found[s | 1 << j & shown] - found[s] for j, s in enumerate(sets)])
                )
            joint = np.asarray(mean_over_orders([jnp.asarray(factor) for factor in factors]))
            np.testing.assert_allclose(joint, found[shown], atol=1e-9)
            assert np.sum(clutter * np.exp(joint)) == pytest.approx(1, abs=1e-6)
            of_label.append(np.exp(joint) / 6)
            evidence = evidence + of_label[-1]
        # Posterior probabilities of the orders average to their prior.
        for part in of_label:
            assert np.sum(clutter * evidence * (part / evidence)) == pytest.approx(1 / 6, abs=1e-6)
        assert (
            len({round(float(np.sum(clutter * np.abs(p - of_label[0]))), 9) for p in of_label}) > 1
        )


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("offsets", [(0.0,), (-2.0, 2.0)])
def test_lines_that_count_for_less_are_a_density_alone_and_beside_another(share, offsets):
    _, clutter = every_line()
    edges = len(offsets)
    table = log_means(
        CLUTTER, detection_probabilities(edges + 1), SIGMA, share, list(offsets), LENGTH
    )
    mean_of = partial(log_mean_of, table, np.int32(edges), reach=REACH)
    (own,) = ratios(offsets, [range(edges)])
    none = np.zeros((0,)), np.zeros((0,), bool)
    assert np.sum(clutter * np.exp(share * own - mean_of(*none))) == pytest.approx(1, abs=5e-3)
    for nu in (0.0, 3.3, -9.0, 16.0):
        both, other = ratios((*offsets, nu), [range(edges + 1), [edges]])
        shared = share * (both - other) - mean_of(np.array([nu]), np.array([True]))
        assert np.sum(clutter * np.exp(other + shared)) == pytest.approx(1, abs=6e-3 * edges)
    assert float(mean_of(np.array([3.0]), np.array([False]))) == float(mean_of(*none))


def test_a_share_without_its_mean_is_no_density():
    _, clutter = every_line()
    (own,) = ratios((0.0,), [[0]])
    assert np.sum(clutter * np.exp(0.5 * own)) < 0.9
    learned = np.asarray(poisson_clutter(1.0, 6))
    table = log_means(learned, detection_probabilities(2), 3.0, 0.5, [0.0], LENGTH)
    assert float(jnp.exp(table[1, 0])) == pytest.approx(0.726, abs=3e-3)  # by 65 536 points
    assert not np.asarray(table[0]).any()
