"""The partitioned kernel: equivalences, layout and bookkeeping."""

import jax
import numpy as np
import pytest
from models import partitioned
from records import assert_equal
from tagged_walk import (
    CHAIN,
    METHODS,
    BreakableJoint,
    D,
    N,
    P,
    T,
    every_method,
    frames,
    start,
    track,
    tracked,
    tracker,
)

from jaxpf import ordering
from jaxpf.contract.state import STATUS_OK
from jaxpf.filters.partitioned import kernel

# Equivalences, key for key.


def test_ps_of_one_partition_is_sir():
    one = {"initial": np.zeros((1, D), np.float32)}
    observed = frames()[:, :1]
    assert_equal(track(ordering.ps([0]), observed, **one), track(ordering.sir(1), observed, **one))


def test_dps_with_one_order_is_ps():
    assert_equal(track(ordering.dps(orders=[[2, 0, 1]])), tracked("ps"))


def test_ps_in_another_order_is_another_filter():
    """So that the equalities above and below mean something."""
    state, _ = track(ordering.ps([0, 1, 2]))
    assert not np.array_equal(state.lineage, tracked("ps")[0].lineage)
    assert not np.array_equal(state.lineage, tracked("sir")[0].lineage)


@pytest.mark.slow
@pytest.mark.parametrize("swap", ordering.SWAPS)
def test_sps_with_one_part_per_level_is_ps(swap):
    by_level = track(ordering.sps(CHAIN, swap), parents=CHAIN)
    assert_equal(by_level, track(ordering.ps([0, 1, 2]), parents=CHAIN))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ps", "dps", "sir"])
def test_the_two_forms_of_partitioned_sampling_draw_the_same_ancestors(method):
    joint = track(METHODS[method](), likelihood=BreakableJoint(np.float32(0.7)))
    factored = tracked(method)
    np.testing.assert_array_equal(joint[0].lineage, factored[0].lineage)
    np.testing.assert_array_equal(joint[0].lagged, factored[0].lagged)
    np.testing.assert_allclose(joint[0].log_weights, factored[0].log_weights, atol=1e-4)
    np.testing.assert_allclose(joint[1].log_evidence, factored[1].log_evidence, atol=1e-4)


def test_swapping_nothing_is_sir_for_independent_objects():
    """One level, hence no resampling inside the frame."""
    assert_equal(tracked("sps-none"), tracked("sir"))


# Layout and bookkeeping.


@every_method
def test_state_has_the_public_layout(method):
    state, summary = tracked(method)
    assert state.substates.shape == state.previous_substates.shape == (T, N, P, D)
    assert state.log_weights.shape == state.component.shape == (T, N)
    assert state.lineage.shape == (T, P, N)
    assert summary.estimate.shape == summary.spread.shape == (T, P, D)
    assert summary.distinct_share.shape == summary.without_likelihood.shape == (T, P)
    for scalar in (summary.log_evidence, summary.ess, summary.status, summary.num_invalid):
        assert scalar.shape == (T,)


def test_substates_keep_their_axes_under_vmap_and_without_it():
    made = tracker(ordering.sir(P))
    state = start(made, jax.random.key(0))
    assert state.substates.shape == (N, P, D)
    now, before = jax.device_get((state.substates, state.previous_substates))
    lagged = np.asarray(state.lagged)
    np.testing.assert_array_equal(now[4, 2], lagged[0, :, 2, 4])
    np.testing.assert_array_equal(before[4, 2], lagged[1, :, 2, 4])
    many = jax.jit(jax.vmap(made.init))(jax.random.split(jax.random.key(0), 5))
    assert many.substates.shape == (5, N, P, D)
    now, lagged = jax.device_get((many.substates, many.lagged))
    np.testing.assert_array_equal(now[3, 4, 2], lagged[3, 0, :, 2, 4])


@every_method
def test_summary_describes_the_weighted_set(method):
    state, summary = tracked(method)
    weights = np.exp(np.asarray(state.log_weights, np.float64))
    np.testing.assert_allclose(weights.sum(-1), 1.0, rtol=1e-5)
    assert (summary.status == STATUS_OK).all()
    assert np.isfinite(summary.log_evidence).all()
    mean = np.einsum("tn,tnpd->tpd", weights, state.substates)
    variance = np.einsum("tn,tnpd->tpd", weights, (state.substates - mean[:, None]) ** 2)
    np.testing.assert_allclose(summary.estimate, mean, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(summary.spread, np.sqrt(variance), rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(summary.ess, 1 / (weights**2).sum(-1), rtol=1e-4)
    assert (summary.ess > 1).all()
    assert (summary.ess < N * 1.0001).all()


@every_method
def test_ids_are_equal_exactly_where_the_draws_are(method):
    state, summary = tracked(method)
    values = np.asarray(state.substates)[..., 0]
    for time in range(T):
        for part in range(P):
            ids, drawn = np.asarray(state.lineage)[time, part], values[time, :, part]
            np.testing.assert_array_equal(
                ids[:, None] == ids[None, :], drawn[:, None] == drawn[None, :]
            )
            assert summary.distinct_share[time, part] == pytest.approx(len(np.unique(drawn)) / N)


def test_uniqueness_tells_which_partition_went_last():
    assert (tracked("sir")[1].distinct_share == 1).all()
    distinct_share = np.asarray(tracked("ps")[1].distinct_share)
    assert (distinct_share[:, 1] == 1).all()  # the order is 2, 0, 1
    assert (distinct_share[:, 2] < distinct_share[:, 0]).all()
    assert (distinct_share[:, 0] < 1).all()


@every_method
def test_the_past_travels_with_its_partition(method):
    state, _ = tracked(method)
    tags, before = np.asarray(state.substates)[..., 1], np.asarray(state.previous_substates)[..., 1]
    np.testing.assert_allclose(tags, before + 1, atol=1e-5)
    starts = start(tracker(METHODS[method]()), jax.random.fold_in(jax.random.key(0), 0))
    known = np.asarray(starts.substates)[..., 1]
    for time in range(T):
        for part in range(P):
            distance = np.abs(tags[time, :, None, part] - (time + 1) - known[None, :, part])
            assert distance.min(axis=1).max() < 1e-4


@pytest.mark.parametrize("method", ["sir", "ps", "dps"])
def test_partitions_of_one_particle_come_from_one_particle(method):
    """Without an exchange a particle's partitions share their ancestor."""
    starts = start(tracker(METHODS[method]()), jax.random.fold_in(jax.random.key(0), 0))
    known = np.asarray(starts.substates)[..., 1]
    tags = np.asarray(tracked(method)[0].substates)[..., 1] - 1 - np.arange(T)[:, None, None]
    nearest = np.abs(tags[:, :, None] - known[None, None]).argmin(axis=2)
    assert (nearest == nearest[..., :1]).all()


@pytest.mark.parametrize("method", ["sps-random", "sps-sorted", "sps-combinatorial"])
def test_an_exchange_mixes_partitions_of_several_particles(method):
    lineage = np.asarray(tracked(method)[0].lineage)
    for time in range(T):
        assert (lineage[time, 0] != lineage[time, 1]).mean() > 0.5


def test_a_permuting_exchange_gives_every_part_away_once():
    for method in ("sps-random", "sps-sorted"):
        assert (np.sort(tracked(method)[0].lineage, axis=-1) == np.arange(N)).all()


def test_the_sorted_swap_pairs_best_with_best():
    """Within the one group of all roots, every part's likelihoods come in the same order."""
    values = np.asarray(tracked("sps-sorted")[0].substates)[0, :, :, 0]
    misfits = np.abs(values - frames()[0, :, 0])
    np.testing.assert_array_equal(np.sort(misfits, axis=0), misfits)


def test_a_set_that_was_never_weighed_is_not_resampled():
    """Multinomial resampling would lose a third of the first draws."""
    state, _ = tracked("sir")
    starts = start(tracker(ordering.sir(P)), jax.random.fold_in(jax.random.key(0), 0))
    np.testing.assert_allclose(state.previous_substates[0], starts.substates, rtol=1e-6)


@pytest.mark.parametrize(("num_particles", "parts"), [(7, 3), (61, 4), (200, 3), (300, 7)])
def test_dps_components_differ_in_size_by_at_most_one(num_particles, parts):
    small = partitioned(ordering.dps(parts), num_particles=num_particles)
    begin = jax.jit(lambda key: kernel.begin(small, key, small.init(key))[1].size)
    sizes = np.asarray(begin(jax.random.key(0)))
    assert sizes.sum() == num_particles
    assert np.ptp(sizes) <= 1
