"""Ancestors: laws, bounds and degenerate weights of every scheme."""

from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from refusals import message_of

from jaxpf.resampling import (
    SCHEMES,
    ancestors,
    components_of_sizes,
    schemes as schemes_of,
    weighted_resample,
)
from jaxpf.resampling.components import few_effective, one_component

WEIGHTS = np.array([0.02, 0.3, 0.0, 0.13, 0.07, 0.21, 0.0, 0.27])
# Sizes of components, an empty one first, between and last.
SIZES = np.array([0, 3, 0, 4, 1, 0])
KEYS = 20_000

schemes = pytest.mark.parametrize("scheme", SCHEMES)


few = jax.jit(few_effective)
divide = jax.jit(components_of_sizes, static_argnums=1)
KEYS_OF_ALL = jax.random.split(jax.random.key(0), KEYS)


def log(weights):
    with np.errstate(divide="ignore"):
        return np.log(np.asarray(weights, np.float32))


def offspring(chosen, num_particles):
    """Counts ``[..., N]`` of ancestors ``[..., N]``."""
    return np.sum(np.asarray(chosen)[..., None] == np.arange(num_particles), axis=-2)


@partial(jax.jit, static_argnames="scheme")
def _resample(keys, log_weights, log_selection, scheme, components):
    selection = log_weights if log_selection is None else log_selection

    def one(key):
        return weighted_resample(key, log_weights, selection, scheme, components)

    return jax.vmap(one)(keys)


def resample(scheme, log_weights, log_selection=None, components=None, keys=KEYS_OF_ALL):
    """Ancestors and new log-weights, ``[K, N]`` each."""
    log_weights = np.asarray(log_weights, np.float32)
    return jax.device_get(_resample(keys, log_weights, log_selection, scheme, components))


def draw(scheme, weights, components=None, count=KEYS):
    """Ancestors ``[K, N]``."""
    return resample(scheme, log(weights), None, components, KEYS_OF_ALL[:count])[0]


@cache
def drawn(scheme):
    """Ancestors ``[K, 8]`` by ``WEIGHTS``."""
    return draw(scheme, WEIGHTS)


def z_scores(samples, expected):
    """In standard errors; where the samples do not vary they must be right."""
    error, deviation = samples.mean(0) - expected, samples.std(0)
    constant = deviation < 1e-9
    np.testing.assert_allclose(error[constant], 0.0, atol=1e-5)
    return error[~constant] / (deviation[~constant] / len(samples) ** 0.5)


# Laws.


@schemes
@pytest.mark.statistical
def test_expected_offspring_are_proportional_to_the_weights(scheme):
    counts = offspring(drawn(scheme), 8)
    assert np.abs(z_scores(counts, 8 * WEIGHTS)).max() < 4.5


@schemes
@pytest.mark.statistical
def test_expected_offspring_are_proportional_within_unequal_components(scheme):
    components = divide(SIZES, 8)
    weights = np.array([0.1, 0.2, 0.7, 5.0, 1.0, 0.0, 2.0, 1e-9])
    counts = offspring(draw(scheme, weights, components), 8)
    expected = np.concatenate([3 * weights[:3], 4 * weights[3:7] / 8, [1.0]])
    assert np.abs(z_scores(counts, expected)).max() < 4.5


@pytest.mark.statistical
def test_multinomial_ancestors_are_independent_draws_from_the_weights():
    chosen = drawn("multinomial")
    possible = WEIGHTS > 0
    counts = offspring(chosen.reshape(1, -1), 8)[0]
    assert counts[~possible].sum() == 0
    assert scipy.stats.chisquare(counts[possible], chosen.size * WEIGHTS[possible]).pvalue > 1e-3
    # Two slots are independent: their joint counts are products.
    pairs = np.zeros((8, 8))
    np.add.at(pairs, (chosen[:, 0], chosen[:, 5]), 1)
    expected = len(chosen) * np.outer(WEIGHTS, WEIGHTS)
    rows = expected > 0
    assert scipy.stats.chisquare(pairs[rows], expected[rows]).pvalue > 1e-3


@pytest.mark.statistical
def test_multinomial_counts_have_the_binomial_variance():
    counts = offspring(drawn("multinomial"), 8)
    np.testing.assert_allclose(counts.var(0), 8 * WEIGHTS * (1 - WEIGHTS), rtol=0.05)


def test_systematic_counts_are_the_floor_or_the_ceiling_within_components():
    rng = np.random.default_rng(1)
    sizes = np.array([5, 0, 17, 1, 41])
    components = divide(sizes, 64)
    weights = rng.gamma(0.5, size=64)
    index = np.repeat(np.arange(5), sizes)
    total = np.bincount(index, weights, 5)
    expected = weights * sizes[index] / total[index]
    counts = offspring(draw("systematic", weights, components, 2000), 64)
    assert (counts >= np.floor(expected - 1e-4)).all()
    assert (counts <= np.ceil(expected + 1e-4)).all()


def test_stratified_slots_take_the_ancestor_of_their_own_stratum():
    chosen = drawn("stratified")
    ends = np.cumsum(WEIGHTS)
    slots = np.arange(8)
    low, high = np.searchsorted(ends, slots / 8, "right"), np.searchsorted(ends, (slots + 1) / 8)
    assert ((chosen >= low) & (chosen <= high)).all()


def test_residual_counts_are_at_least_the_floor():
    counts = offspring(drawn("residual"), 8)
    assert (counts >= np.floor(8 * WEIGHTS)).all()
    assert len(np.unique(counts, axis=0)) > 10  # the rest is random


@pytest.mark.parametrize("rounding", [0, 1, -1])
def test_residual_keeps_every_particle_of_equal_weights(rounding, monkeypatch):
    """Even if a platform's division is off in the last place."""
    weights = np.ones(300, np.float32)
    weights[::7] -= np.float32(2**-24)
    expected = schemes_of._expected
    step = np.float32(rounding)

    def rounded(values, total, components):
        found = expected(values, total, components)
        return found if rounding == 0 else jnp.nextafter(found, found + step)

    monkeypatch.setattr(schemes_of, "_expected", rounded)
    draw = jax.jit(lambda key, x: ancestors(key, x, "residual"))
    for given in (weights, np.ones(300, np.float32)):
        chosen = draw(jax.random.key(0), np.log(given))
        np.testing.assert_array_equal(np.sort(chosen), np.arange(300))


def test_more_particles_than_float32_reaches_are_refused():
    def draw(count):
        weights = jax.ShapeDtypeStruct((count,), jnp.float32)
        return jax.eval_shape(lambda x: ancestors(jax.random.key(0), x, "multinomial"), weights)

    assert draw(2**23).shape == (2**23,)
    assert "8388609 particles" in message_of(draw, 2**23 + 1)


@pytest.mark.statistical
def test_residual_rest_is_multinomial_on_what_is_left():
    counts = offspring(drawn("residual"), 8)
    floors = np.floor(8 * WEIGHTS)
    left = 8 * WEIGHTS - floors
    share = left / left.sum()
    rest = 8 - floors.sum()
    np.testing.assert_allclose(counts.var(0), rest * share * (1 - share), rtol=0.06, atol=1e-3)


@schemes
@pytest.mark.statistical
@pytest.mark.parametrize("same", [True, False], ids=["by-weight", "by-another-function"])
def test_weighted_resampling_preserves_weighted_sums(scheme, same):
    """``E[sum_i w'_i f(x_i)] = sum_i w_i f(x_i)``, in every component on its own."""
    rng = np.random.default_rng(2)
    components = divide(np.array([0, 3, 0, 4, 0, 1]), 8)
    log_weights = rng.normal(size=8).astype(np.float32)
    log_selection = None if same else rng.normal(size=8).astype(np.float32)
    values = np.stack([np.ones(8), rng.normal(size=8), np.arange(8.0)])
    chosen, new = resample(scheme, log_weights, log_selection, components)
    index = np.asarray(components.index)
    for component in (1, 3, 5):
        mine = index == component
        sums = np.einsum("rn,frn->rf", np.exp(new[:, mine]), values[:, chosen[:, mine]])
        exact = values[:, mine] @ np.exp(log_weights)[mine]
        error, spread = sums.mean(0) - exact, sums.std(0)
        # Rounding of float32 counts where the sums do not vary.
        assert (np.abs(error) < 4.5 * spread / KEYS**0.5 + 2e-6 * np.abs(exact).max()).all()


@schemes
def test_resampling_by_the_weight_leaves_equal_weights(scheme):
    _, new = resample(scheme, log(WEIGHTS), components=divide(SIZES, 8))
    sums = [WEIGHTS[:3].sum() / 3, WEIGHTS[3:7].sum() / 4, WEIGHTS[7]]
    np.testing.assert_allclose(np.exp(new[0]), np.repeat(sums, [3, 4, 1]), rtol=1e-5)
    assert (new == new[0]).all()


@schemes
def test_scale_of_the_weights_does_not_matter(scheme):
    shifted, _ = resample(scheme, log(WEIGHTS) - 690.0)
    # Near -690, float32 rounds weights by some 1e-5.
    assert np.mean(shifted != drawn(scheme)) < 1e-4
    np.testing.assert_array_equal(shifted[:500], drawn(scheme)[:500])


# Components.


@schemes
def test_ancestors_stay_in_their_component_for_sizes_known_at_run_time(scheme):
    log_weights = log(np.random.default_rng(0).gamma(0.3, size=8))
    for sizes in ([8, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 8], [1, 0, 6, 0, 1, 0], [0, 3, 0, 0, 0, 5]):
        index = np.repeat(np.arange(6), sizes)
        chosen, _ = resample(scheme, log_weights, components=divide(np.array(sizes), 8))
        assert (index[chosen] == index).all()


def test_components_of_sizes_lays_them_side_by_side():
    components = divide(SIZES, 8)
    np.testing.assert_array_equal(components.index, [1, 1, 1, 3, 3, 3, 3, 4])
    np.testing.assert_array_equal(components.start, [0, 0, 3, 3, 7, 8])
    np.testing.assert_array_equal(components.size, SIZES)


# Degenerate weights.


@schemes
def test_a_single_particle_is_its_own_ancestor(scheme):
    for value in (0.0, -690.0, -np.inf, np.nan):
        chosen, new = resample(scheme, [value], keys=KEYS_OF_ALL[:1])
        assert chosen.tolist() == [[0]]
        np.testing.assert_array_equal(new, np.float32([[value]]))


@schemes
@pytest.mark.parametrize("position", [0, 3, 7])
def test_the_only_living_particle_has_all_offspring(scheme, position):
    for alive in (0.0, -690.0, 300.0):
        chosen, new = resample(scheme, np.where(np.arange(8) == position, alive, -np.inf))
        assert (chosen == position).all()
        np.testing.assert_allclose(new, np.full(new.shape, alive - np.log(8)), rtol=1e-6)


@schemes
def test_weights_of_1e_minus_300_are_resampled_as_others_are(scheme):
    chosen, _ = resample(scheme, [-690.0, -690.0 + np.log(3), -np.inf, *[-2000.0] * 5])
    counts = offspring(chosen, 8)
    assert counts[:, 2:].sum() == 0
    np.testing.assert_allclose(counts.mean(0)[:2], [2, 6], atol=0.1)


@schemes
def test_weights_that_are_all_zero_leave_everything_as_it_was(scheme):
    nothing = np.full(8, -np.inf)
    chosen, new = resample(scheme, nothing)
    assert (chosen == np.arange(8)).all()
    assert (new == nothing).all()


@schemes
def test_a_dead_component_stays_beside_a_living_one(scheme):
    log_weights = log([0, 0, 0, 0, 0, 1, 0, 0])
    chosen, new = resample(scheme, log_weights, components=divide(SIZES, 8))
    assert (chosen == [0, 1, 2, 5, 5, 5, 5, 7]).all()
    expected = np.full(8, -np.inf)
    expected[3:7] = -np.log(4)
    np.testing.assert_allclose(new, np.broadcast_to(expected, new.shape), rtol=1e-6)


@schemes
def test_infinite_weights_share_all_offspring(scheme):
    log_weights = np.float32([0, np.inf, -np.inf, np.inf, 1, 1, np.nan, 3])
    draw = jax.jit(ancestors, static_argnums=2)
    halves, whole = (
        draw(jax.random.key(0), log_weights, scheme, divide(np.array(sizes), 8))
        for sizes in ([0, 4, 4], [0, 8, 0])
    )
    assert set(np.asarray(halves[:4]).tolist()) <= {1, 3}
    assert set(np.asarray(halves[4:]).tolist()) <= {4, 5, 7}
    assert set(np.asarray(whole).tolist()) <= {1, 3}


@schemes
def test_nan_counts_as_zero_weight(scheme):
    log_weights = np.float32([np.nan, 0.0] * 4)
    chosen, _ = resample(scheme, log_weights)
    assert set(np.unique(chosen)) == {1, 3, 5, 7}
    _, new = resample(scheme, np.zeros(8), log_weights, divide(SIZES, 8))
    assert np.isfinite(new).all()


@schemes
@pytest.mark.slow
def test_dead_particles_never_have_offspring_among_a_million_in_float32(scheme):
    rng = np.random.default_rng(3)
    log_weights = rng.normal(size=1_000_000).astype(np.float32)
    dead = rng.random(1_000_000) < 0.5
    dead[:1000] = dead[-1000:] = True
    log_weights[dead] = -np.inf
    log_weights = jnp.asarray(log_weights)
    one = jax.jit(lambda key, components: ancestors(key, log_weights, scheme, components))
    for components in (
        one_component(1_000_000),
        components_of_sizes(jnp.array([300_000, 0, 699_000, 1_000]), 1_000_000),
    ):
        for seed in range(2):
            chosen = np.asarray(one(jax.random.key(seed), components))
            kept = chosen == np.arange(1_000_000)
            inside = np.asarray(components.index) != 3
            # The last component is dead altogether and keeps its particles.
            assert not dead[chosen[inside]].any()
            assert kept[~inside].all()


@schemes
def test_flat_weights_keep_every_particle_unless_drawn_independently(scheme):
    drawn = draw(scheme, np.ones(300), count=20)
    uniques = [len(np.unique(one)) for one in drawn]
    if scheme == "multinomial":
        # 1 - (1 - 1/N)^N = .6327 of them survive.
        assert np.mean(uniques) / 300 == pytest.approx(0.633, abs=0.02)
    elif scheme == "stratified":
        # One point per stratum: only rounding at an edge could lose a particle.
        assert min(uniques) >= 299
    else:
        assert min(uniques) == 300


# Adaptive resampling.


def test_few_effective_compares_each_component_with_its_own_size():
    log_weights = log([1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    found = few(log_weights, divide(np.array([4, 0, 4]), 8), 0.5)
    assert not found[0]
    assert found[2]


def test_few_effective_is_true_at_the_threshold_itself():
    half, whole = log([1.0, 1.0, 0.0, 0.0]), one_component(4)
    assert few(half, whole, 0.5).all()
    assert not few(half, whole, 0.49).any()


def test_unknown_scheme_is_refused_by_name():
    named = "resampling='bootstrap'"
    assert named in message_of(resample, "bootstrap", np.zeros(3), keys=KEYS_OF_ALL[:1])
