"""The label of depth: kept while shapes overlap, flipped now and then while they do not."""

from itertools import combinations, permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import message_of

from jaxpf import pytree_dataclass
from jaxpf.dynamics import RandomWalk, WithOcclusion
from jaxpf.shapes import in_front
from jaxpf.shapes.depth import depth_orders

RUNS = 40_000


@pytree_dataclass
class Discs:
    """Discs of radius 1."""

    def overlap(self, substates, one=0, other=1):
        return jnp.abs(substates[one, 0] - substates[other, 0]) < 2


DYNAMICS = WithOcclusion(RandomWalk(scale=0.5), Discs())


@jax.jit
def drawn(dynamics, keys, label, places):
    """The label after each draw."""
    return jax.vmap(lambda key: dynamics.propagate_label(key, label, places[:, None]))(keys)


def test_substates_move_as_without_occlusion():
    arguments = jnp.zeros(4, int), *[jnp.ones((2, 4))] * 3
    for name, given in (
        ("propagate_all", (jax.random.key(3), *arguments)),
        ("log_density_all", (*arguments, jnp.ones((2, 4)))),
    ):
        found, expected = (getattr(each, name)(*given) for each in (DYNAMICS, DYNAMICS.dynamics))
        np.testing.assert_array_equal(found, expected)


#: Places of discs, of which those overlap that are less than 2 apart.
SETTINGS = {
    "two apart": (0.0, 3.0),
    "two over": (0.0, 1.0),
    "all apart": (0.0, 3.0, 6.0),
    "one pair": (0.0, 1.0, 6.0),
    "a chain": (0.0, 1.5, 3.0),
    "all over": (0.0, 0.5, 1.0),
    "two pairs": (0.0, 1.0, 6.0, 7.0),
    "a star": (3.0, 1.5, 4.5, 9.0),
}


def moves(places, flip):
    """Probabilities ``[from, to]`` of the label's moves."""
    dynamics = WithOcclusion(RandomWalk(scale=0.5), Discs(), flip)
    labels = np.arange(len(depth_orders(len(places))))
    return np.exp(np.asarray(log_labels(dynamics, labels, jnp.array(places)[:, None]), float))


@jax.jit
def log_labels(dynamics, labels, substates):
    every = jax.vmap(jax.vmap(dynamics.log_label, in_axes=(0, None, None)), in_axes=(None, 0, None))
    return every(labels, labels, substates)


def by_definition(places, flip):
    """The same, told in words: neighbours in depth change places unless they overlap."""
    orders = list(permutations(range(len(places))))
    table = np.zeros((len(orders), len(orders)))
    for here, order in enumerate(orders):
        for place in range(len(places) - 1):
            one, other = order[place : place + 2]
            there = list(order)
            if abs(places[one] - places[other]) >= 2:
                there[place : place + 2] = other, one
            table[here, orders.index(tuple(there))] += flip / (len(places) - 1)
        table[here, here] += 1 - flip
    return table


@pytest.mark.parametrize("name", SETTINGS)
def test_an_order_changes_between_neighbours_that_do_not_overlap(name):
    places = SETTINGS[name]
    np.testing.assert_allclose(moves(places, 0.3), by_definition(places, 0.3), atol=1e-6)


@pytest.mark.parametrize("name", SETTINGS)
def test_all_orders_that_keep_overlapping_pairs_become_equally_likely(name):
    places = SETTINGS[name]
    table = moves(places, 0.3)
    np.testing.assert_allclose(table, table.T, atol=1e-6)  # reversible
    over = [pair for pair in combinations(range(len(places)), 2) if _are_over(places, *pair)]
    orders = list(permutations(range(len(places))))
    kept = [tuple(order.index(i) < order.index(j) for i, j in over) for order in orders]
    admissible = np.array([[one == other for other in kept] for one in kept], float)
    in_the_end = np.linalg.matrix_power(table / table.sum(axis=1, keepdims=True), 2000)
    np.testing.assert_allclose(
        in_the_end, admissible / admissible.sum(axis=1, keepdims=True), atol=1e-6
    )


def _are_over(places, one, other):
    return abs(places[one] - places[other]) < 2


@pytest.mark.parametrize("flip", [0.0, 0.7])
@pytest.mark.parametrize("name", ["two apart", "one pair", "a star"])
def test_labels_are_drawn_with_the_probabilities_that_are_told(name, flip):
    places = SETTINGS[name]
    dynamics = WithOcclusion(RandomWalk(scale=0.5), Discs(), flip)
    table = moves(places, flip)
    for label in (0, len(table) - 1):
        keys = jax.random.split(jax.random.key(label), RUNS)
        moved = np.asarray(drawn(dynamics, keys, label, jnp.array(places)))
        shares, expected = np.bincount(moved, minlength=len(table)) / RUNS, table[label]
        error = np.sqrt(expected * (1 - expected) / RUNS)
        assert (np.abs(shares - expected) <= 4.5 * error + 1e-6).all()


def test_who_is_in_front_of_whom_is_read_from_labels():
    np.testing.assert_allclose(in_front([0.7, 0.3]), [[0, 0.7], [0.3, 0]])
    probabilities = np.random.default_rng(0).dirichlet(np.ones(6), 5)
    found = in_front(probabilities)
    assert found.shape == (5, 3, 3)
    for i, j in permutations(range(3), 2):
        expected = sum(
            probabilities[:, label]
            for label, order in enumerate(depth_orders(3))
            if order.index(i) < order.index(j)
        )
        np.testing.assert_allclose(found[:, i, j], expected)
    assert "5 opaque target" in message_of(depth_orders, 5)
