"""Exchanging parts: factors, draws within groups and the groups that come of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf import ordering
from jaxpf.filters.partitioned import exchange
from jaxpf.lowering.threefry import written_out

#: Particles 0 to 7 in three groups, told by the particle's part of the level above.
GROUP = np.array([2, 0, 2, 5, 0, 2, 2, 0])
LIKELIHOOD = np.array([3.0, 1.0, 0.0, 7.0, 4.0, 2.0, 1.0, 0.0])
ANCESTORS = np.array([6, 0, 1, 0, 3, 0, 5, 4])
DRAWS = 40_000
#: Of some hundred frequencies none is off by more, but once in ten thousand times.
SIGMAS = 5.0
COMBINATORIAL = np.int32(ordering.SWAPS.index("combinatorial"))


def layout(group):
    """Groups by sorting."""
    order = np.argsort(group, kind="stable")
    ordered, places = group[order], np.arange(len(group))
    return exchange.Groups(
        *(
            row.astype(np.int32)
            for row in (
                order,
                np.argsort(order),
                places - np.searchsorted(ordered, ordered),
                np.searchsorted(ordered, ordered, side="right") - 1,
            )
        )
    )


@jax.jit
def weigh(log_probs, groups, is_root=False):
    """Factors ``[N]`` of the combinatorial rule, and the offer that a draw needs."""
    key, lineage = jax.random.key(0), groups.order  # which the other rules use
    return exchange.weigh(key, COMBINATORIAL, log_probs, groups, lineage, jnp.bool_(is_root))


families = jax.jit(exchange.families)


def draw(key, offer, groups, slots, is_root=False):
    key = written_out(key)
    return exchange.draw(key, COMBINATORIAL, offer, groups, slots, jnp.bool_(is_root))


one_draw = jax.jit(draw)


def draw_many(keys, offer, groups, slots, is_root=False):
    return jax.vmap(lambda key: draw(key, offer, groups, slots, is_root))(keys)


many_draws = jax.jit(draw_many)


def draws(likelihood=LIKELIHOOD, group=GROUP, seed=0, many=many_draws):
    """Givers ``[DRAWS, N]`` and groups of as many draws of one part, and the slots' order."""
    with np.errstate(divide="ignore"):
        log_probs = np.log(likelihood)
    groups, slots = layout(group), families(ANCESTORS)
    _, offer = weigh(log_probs, groups)
    giver, shared = many(jax.random.split(jax.random.key(seed), DRAWS), offer, groups, slots)
    return jax.device_get((giver, shared, slots.ancestors))


def law(likelihood, group):
    """``[N, N]``: the probability of each giver for a slot, by the slot's ancestor."""
    same = np.asarray(group)[:, None] == np.asarray(group)[None, :]
    weight = np.where(same, likelihood, 0.0)
    return weight / weight.sum(axis=1, keepdims=True)


def worst_score(hits, probability):
    """Largest distance of a frequency from its probability, in standard errors."""
    error = np.sqrt(np.maximum(probability * (1 - probability), 1e-12) / DRAWS)
    return np.max(np.abs(hits - probability) / error)


def joint(first, second):
    """``[N, N, N]``: how often a slot takes one part from i and the other from j."""
    numbers = np.arange(first.shape[1])
    is_first = (first[..., None] == numbers).astype(np.float32)
    is_second = (second[..., None] == numbers).astype(np.float32)
    return np.einsum("dsi,dsj->sij", is_first, is_second) / len(first)


def test_the_factor_is_the_mean_of_the_group():
    groups = layout(GROUP)
    with np.errstate(divide="ignore"):
        factor, _ = weigh(np.log(LIKELIHOOD), groups)
    mean = [LIKELIHOOD[group == GROUP].mean() for group in GROUP]
    np.testing.assert_allclose(np.exp(factor), mean, rtol=1e-6)


def test_a_group_far_below_the_others_keeps_its_factor_and_a_dead_one_has_none():
    log_probs = np.array([-1000.0, 0.0, -1001.0, -np.inf, 0.0, -1000.0, -1000.0, 0.0])
    factor, offer = weigh(log_probs, layout(GROUP))
    mean = -1000 + np.log((3 + np.exp(-1)) / 4)
    np.testing.assert_allclose(np.asarray(factor)[[0, 2, 5, 6]], mean, rtol=1e-6)
    assert np.asarray(factor)[3] == -np.inf
    assert np.all(np.isfinite(offer.share))


def test_a_slot_draws_from_its_ancestors_group_in_proportion_to_the_likelihood():
    giver, _, ancestors = draws()
    np.testing.assert_array_equal(ancestors, np.sort(ANCESTORS))
    hits = (giver[..., None] == np.arange(8)).mean(axis=0)
    assert worst_score(hits, law(LIKELIHOOD, GROUP)[ancestors]) < SIGMAS
    assert np.all(hits[law(LIKELIHOOD, GROUP)[ancestors] == 0] == 0)


@pytest.mark.parametrize("other_group", [GROUP, np.array([0, 1, 0, 1, 1, 0, 1, 0])])
def test_a_slots_draws_of_two_parts_are_independent(other_group):
    other = np.array([1.0, 5.0, 2.0, 1.0, 3.0, 0.5, 1.0, 6.0])
    first, _, ancestors = draws()
    second, _, _ = draws(other, other_group, seed=1)
    expected = law(LIKELIHOOD, GROUP)[ancestors], law(other, other_group)[ancestors]
    product = np.einsum("si,sj->sij", *expected)
    assert worst_score(joint(first, second), product) < SIGMAS


def test_the_offset_is_what_makes_them_so(monkeypatch):
    """Slots of a group in order of its members: at its ends the small shares come too often."""
    original = jax.random.bits

    def without_offset(key, shape=(), dtype=None):
        return original(key, shape, dtype).at[1].set(0)

    monkeypatch.setattr(jax.random, "bits", without_offset)
    anew = jax.jit(lambda *given: draw_many(*given))
    giver, _, ancestors = draws(many=anew)
    hits = (giver[..., None] == np.arange(8)).mean(axis=0)
    assert worst_score(hits, law(LIKELIHOOD, GROUP)[ancestors]) > 4 * SIGMAS


def test_who_draws_the_same_part_forms_a_group():
    giver, shared, _ = draws()
    for taken, *rows in zip(giver[:50], *(rows[:50] for rows in shared), strict=True):
        order, position, rank, last = rows
        np.testing.assert_array_equal(order[position], np.arange(8))
        ordered, places = taken[order], np.arange(8)
        for place in places:
            members = places[ordered == ordered[place]]
            assert rank[place] == place - members[0]
            assert last[place] == members[-1] == members[0] + len(members) - 1


@pytest.mark.parametrize(
    "num_particles", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (200, 5000)), 69_300]
)
def test_every_slot_takes_another_place_of_its_group(num_particles):
    """Equal parts are given away once each, also where small primes divide the group's size."""
    numbers = np.arange(num_particles)
    groups, slots = layout(np.zeros(num_particles, int)), families(numbers)
    _, offer = weigh(np.zeros(num_particles, np.float32), groups)
    for key in jax.random.split(jax.random.key(0), 10):
        giver, shared = one_draw(key, offer, groups, slots)
        np.testing.assert_array_equal(np.sort(giver), numbers)
        np.testing.assert_array_equal(np.sort(shared.position), numbers)


def test_families_bring_ancestors_in_order():
    found = families(ANCESTORS)
    np.testing.assert_array_equal(found.ancestors, np.sort(ANCESTORS))
    np.testing.assert_array_equal(found.size, np.bincount(ANCESTORS, minlength=8))
    groups = jax.jit(exchange.Families.groups)(found)
    np.testing.assert_array_equal(groups.order, np.arange(8))
    np.testing.assert_array_equal(groups.rank, [0, 1, 2, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(groups.last, [2, 2, 2, 3, 4, 5, 6, 7])


def test_roots_are_one_group_of_all():
    """The short way for roots gives what the general one gives for a single group."""
    log_probs = np.log(LIKELIHOOD + 0.1)
    everyone = layout(np.zeros(8, int))
    slots = families(ANCESTORS)
    found, expected = (weigh(log_probs, everyone, is_root=root) for root in (True, False))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), found, expected)
    keys = jax.random.split(jax.random.key(0), DRAWS)
    short, general = (many_draws(keys, found[1], everyone, slots, root) for root in (True, False))
    jax.tree.map(np.testing.assert_array_equal, short, general)
