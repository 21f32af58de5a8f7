"""The partitioned kernel: equivalences, layout, lags, lineage, degenerate frames, refusals.

Most tests run one compiled kernel: orderings, and frames that break, are data.
"""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import InputError
from jaxpf.filters.partitioned import kernel, ordering
from jaxpf.models.dynamics import IndependentGaussian, RandomWalk
from jaxpf.models.likelihoods.gaussian import CorrelatedGaussian, Gaussian
from jaxpf.pytree import pytree_dataclass
from jaxpf.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_LOST,
    STATUS_OK,
    count_unique,
)

N, P, D, T = 60, 3, 2, 3
CHAIN = (-1, 0, 1)


@pytree_dataclass
class TaggedWalk:
    """Dimension 0 walks at random, dimension 1 counts frames on from its start."""

    scale: jax.Array

    def propagate(self, key, partition, current, previous, parent):
        step = self.scale * jax.random.normal(key, (), current.dtype)
        return jnp.stack([current[0] + 0.5 * (current[0] - previous[0]) + step, current[1] + 1])


@pytree_dataclass
class Breakable:
    """Normal, but beyond an edge the frame's ``beyond`` is added to a log-likelihood."""

    noise: jax.Array

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        y, edge, beyond = observation[partition]
        value = -0.5 * ((y - substate[0]) / self.noise) ** 2
        return value + jnp.where(substate[0] > edge, beyond, 0.0)


@pytree_dataclass
class BreakableJoint(Breakable):
    """The same likelihood, told as one that might not factor."""

    def log_joint(self, observation, substates, log_probs):
        return jnp.sum(log_probs)


def frames(edge=None, beyond=0.0, time=1, partition=None):
    """``[T, P, 3]``; what lies beyond the edge is broken in one frame, in one partition or all."""
    made = np.zeros((T, P, 3), np.float32)
    made[:, :, 0] = np.random.default_rng(0).normal(size=(T, P))
    made[:, :, 1] = np.inf
    if edge is not None:
        where = slice(None) if partition is None else partition
        made[time, where, 1:] = edge, beyond
    return made


def tracker(order, **settings):
    defaults = {
        "dynamics": TaggedWalk(np.float32(1.0)),
        "likelihood": Breakable(np.float32(0.7)),
        "initial": IndependentGaussian(
            mean=np.zeros((P, D), np.float32), scale=np.array([1.0, 5.0], np.float32)
        ),
        "num_particles": N,
        "resampling": "multinomial",
    }
    return jaxpf.Partitioned(ordering=order, **(defaults | settings))


def everything(state, summary):
    return state, summary


def track(order, observed=None, seed=0, **settings):
    """States and summaries of a run, leading axis T."""
    observed = frames() if observed is None else observed
    made = tracker(order, **settings)
    return jax.device_get(jaxpf.run(made, jax.random.key(seed), observed, everything)[1])


def assert_equal(one, other):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


METHODS = {
    "sir": lambda: ordering.sir(P),
    "ps": lambda: ordering.ps([2, 0, 1]),
    "dps": lambda: ordering.dps(P),
    "dps-literal": lambda: ordering.dps(P, reassembly="literal"),
    "sps-none": lambda: ordering.sps(num_partitions=P, swap="none"),
    "sps-random": lambda: ordering.sps(num_partitions=P, swap="random"),
    "sps-sorted": lambda: ordering.sps(num_partitions=P, swap="sorted"),
    "sps-combinatorial": lambda: ordering.sps(num_partitions=P),
}
every_method = pytest.mark.parametrize("method", METHODS)


@functools.cache
def tracked(method):
    return track(METHODS[method]())


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
    assert summary.uniqueness.shape == summary.lost.shape == (T, P)
    for scalar in (summary.log_evidence, summary.ess, summary.status, summary.num_invalid):
        assert scalar.shape == (T,)


def test_substates_keep_their_axes_under_vmap_and_without_it():
    state = tracker(ordering.sir(P)).init(jax.random.key(0))
    assert state.substates.shape == (N, P, D)
    np.testing.assert_array_equal(state.substates[4, 2], state.lagged[0, :, 2, 4])
    np.testing.assert_array_equal(state.previous_substates[4, 2], state.lagged[1, :, 2, 4])
    many = jax.vmap(tracker(ordering.sir(P)).init)(jax.random.split(jax.random.key(0), 5))
    assert many.substates.shape == (5, N, P, D)
    np.testing.assert_array_equal(many.substates[3, 4, 2], many.lagged[3, 0, :, 2, 4])


@every_method
def test_weights_are_normalised(method):
    state, summary = tracked(method)
    np.testing.assert_allclose(np.exp(state.log_weights).sum(-1), 1.0, rtol=1e-5)
    assert (summary.status == STATUS_OK).all()
    assert np.isfinite(summary.log_evidence).all()


@every_method
def test_summary_describes_the_weighted_set(method):
    state, summary = tracked(method)
    weights = np.exp(np.asarray(state.log_weights, np.float64))
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
            assert summary.uniqueness[time, part] == pytest.approx(len(np.unique(drawn)) / N)


def test_uniqueness_tells_which_partition_went_last():
    assert (tracked("sir")[1].uniqueness == 1).all()
    uniqueness = np.asarray(tracked("ps")[1].uniqueness)
    assert (uniqueness[:, 1] == 1).all()  # the order is 2, 0, 1
    assert (uniqueness[:, 2] < uniqueness[:, 0]).all()
    assert (uniqueness[:, 0] < 1).all()


def test_count_unique_by_hand():
    lineage = jnp.array([[0, 0, 0, 0], [3, 1, 3, 1], [0, 1, 2, 3]])
    np.testing.assert_array_equal(count_unique(lineage), [1, 2, 4])


@every_method
def test_the_past_travels_with_its_partition(method):
    state, _ = tracked(method)
    tags, before = np.asarray(state.substates)[..., 1], np.asarray(state.previous_substates)[..., 1]
    np.testing.assert_allclose(tags, before + 1, atol=1e-5)
    starts = tracker(METHODS[method]()).init(jax.random.fold_in(jax.random.key(0), 0))
    known = np.asarray(starts.substates)[..., 1]
    for time in range(T):
        for part in range(P):
            distance = np.abs(tags[time, :, None, part] - (time + 1) - known[None, :, part])
            assert distance.min(axis=1).max() < 1e-4


@pytest.mark.parametrize("method", ["sir", "ps", "dps"])
def test_partitions_of_one_particle_come_from_one_particle(method):
    """Without an exchange a particle's partitions share their ancestor."""
    made = tracker(METHODS[method]())
    starts = made.init(jax.random.fold_in(jax.random.key(0), 0))
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
    starts = tracker(ordering.sir(P)).init(jax.random.fold_in(jax.random.key(0), 0))
    np.testing.assert_allclose(state.previous_substates[0], starts.substates, rtol=1e-6)


@pytest.mark.parametrize(("num_particles", "parts"), [(7, 3), (61, 4), (200, 3), (300, 7)])
def test_dps_components_differ_in_size_by_at_most_one(num_particles, parts):
    small = jaxpf.Partitioned(
        dynamics=RandomWalk(np.float32(1.0)),
        likelihood=Gaussian(noise=np.ones((parts, 1, 1), np.float32)),
        ordering=ordering.dps(parts),
        initial=np.zeros((parts, 1), np.float32),
        num_particles=num_particles,
    )
    begin = jax.jit(lambda key: kernel.begin(small, key, small.init(key))[0].size)
    sizes = np.asarray(begin(jax.random.key(0)))
    assert sizes.sum() == num_particles
    assert np.ptp(sizes) <= 1


# Run-time labels.


@functools.cache
def branched_run():
    orders = [[0, 1, 2], [2, 1, 0], [1, 0, 2]]
    made = tracker(ordering.branched(orders))
    state = made.init(jax.random.key(1))
    labels = jnp.where(state.substates[:, 0, 1] > 2.0, 1, 0).astype(jnp.int32)
    state = dataclasses.replace(state, component=labels)
    step = jax.jit(lambda key, state, frame: made.step(key, state, frame))
    states = [state]
    for time, frame in enumerate(frames()):
        state, _ = step(jax.random.key(10 + time), state, frame)
        states.append(state)
    return states


@pytest.mark.slow
def test_particles_keep_their_label():
    for time, state in enumerate(branched_run()):
        expected = np.asarray(state.substates)[:, 0, 1] - time > 2.0
        np.testing.assert_array_equal(np.asarray(state.component) == 1, expected)
        assert 0 < expected.sum() < N


@pytest.mark.slow
def test_each_branch_follows_its_own_order():
    for state in branched_run()[1:]:
        lineage, labels = np.asarray(state.lineage), np.asarray(state.component)
        for label, first, last in ((0, 0, 2), (1, 2, 0)):
            mine = lineage[:, labels == label]
            assert len(np.unique(mine[last])) == mine.shape[1]
            assert len(np.unique(mine[first])) < mine.shape[1]


# Exchanges stay within a lineage.


@pytree_dataclass
class ForgetfulRoot:
    """The root becomes zero in every particle; its parts become noise."""

    scale: jax.Array

    def propagate(self, key, partition, current, previous, parent):
        noise = self.scale * jax.random.normal(key, current.shape, current.dtype)
        return jnp.where(partition == 0, 0.0, noise)


def one_tag_for_all(key):
    return jnp.broadcast_to(jax.random.normal(key, ()), (P, D))


@pytest.mark.slow
@pytest.mark.parametrize("swap", ["random", "sorted", "combinatorial"])
def test_swap_groups_compare_lineages_not_values(swap):
    """All roots have one value, yet siblings are exchanged only under one draw of the root."""
    tree = (-1, 0, 0)
    settings = {
        "parents": tree,
        "dynamics": ForgetfulRoot(np.float32(1.0)),
        "initial": jax.tree_util.Partial(one_tag_for_all),
    }
    state, _ = track(ordering.sps(tree, swap), **settings)
    root_ids, arm, other_arm = np.asarray(state.lineage)[0]
    tags = np.asarray(state.previous_substates)[0, :, :, 0]
    np.testing.assert_array_equal(tags, np.repeat(tags[:, :1], P, axis=1))
    assert len(np.unique(root_ids)) < N  # there are groups of more than one
    assert (arm != other_arm).any()  # and parts were exchanged in them


# Degenerate frames.


@every_method
@pytest.mark.parametrize("bad", [np.nan, np.inf], ids=["nan", "inf"])
def test_invalid_likelihoods_are_impossible_and_counted(method, bad):
    state, summary = track(METHODS[method](), frames(0.3, bad, partition=1))
    assert (summary.status == [STATUS_OK, STATUS_INVALID_LIKELIHOOD, STATUS_OK]).all()
    assert summary.num_invalid[0] == summary.num_invalid[2] == 0
    assert 0 < summary.num_invalid[1] < N
    weights = np.exp(np.asarray(state.log_weights)[1])
    assert not weights[np.asarray(state.substates)[1, :, 1, 0] > 0.3].any()
    assert np.isfinite(summary.log_evidence).all()
    assert np.isfinite(summary.estimate).all()


def test_invalid_likelihoods_are_counted_one_by_one():
    state, summary = track(ordering.sir(P), frames(0.3, np.nan))
    beyond = np.asarray(state.substates)[1, :, :, 0] > 0.3
    assert summary.num_invalid[1] == beyond.sum()


@every_method
def test_an_impossible_frame_is_reported_and_left_out(method):
    state, summary = track(METHODS[method](), frames(-np.inf, -np.inf))
    assert summary.status[1] == STATUS_IMPOSSIBLE + STATUS_LOST
    assert summary.lost[1].all()
    assert np.isneginf(summary.log_evidence[1])
    # The weights are what they were: equal, since the frame began with a resampling.
    np.testing.assert_allclose(state.log_weights[1], -np.log(N), rtol=1e-5)
    assert np.isfinite(summary.estimate).all()
    assert np.isfinite(summary.spread).all()
    assert (summary.status[[0, 2]] == STATUS_OK).all()
    assert np.isfinite(summary.log_evidence[np.array([0, 2])]).all()


@every_method
def test_a_lost_object_is_named_and_the_others_are_tracked_on(method):
    _, summary = track(METHODS[method](), frames(-np.inf, -np.inf, partition=1))
    np.testing.assert_array_equal(summary.lost, [[False] * 3, [False, True, False], [False] * 3])
    assert summary.status[1] == STATUS_IMPOSSIBLE + STATUS_LOST
    assert np.isneginf(summary.log_evidence[1])
    assert np.isfinite(summary.estimate).all()
    # The other objects' likelihoods still count: as they do in the same run without object 1.
    sure = np.asarray(summary.spread)[1, [0, 2], 0]
    unsure = np.asarray(summary.spread)[1, 1, 0]
    assert (sure < 0.9 * unsure).all()


def test_objects_of_dead_particles_may_be_anything():
    """A dead particle that holds NaN does not spoil the estimate."""

    state, summary = track(
        ordering.sir(P), frames(0.3, np.nan), dynamics=NanBeyond(np.float32(1.0))
    )
    assert np.isnan(np.asarray(state.substates)[1]).any()
    assert np.isfinite(summary.estimate[1]).all()
    assert np.isfinite(summary.spread[1]).all()


@pytree_dataclass
class NanBeyond:
    scale: jax.Array

    def propagate(self, key, partition, current, previous, parent):
        moved = current + self.scale * jax.random.normal(key, current.shape, current.dtype)
        return jnp.where(moved[0] > 1.5, jnp.nan, moved)


# Dtypes.


def dtypes(made, observed):
    state = jax.eval_shape(made.init, jax.random.key(0))
    after, summary = jax.eval_shape(made.step, jax.random.key(0), state, observed)
    assert jax.tree.map(lambda x: (x.shape, x.dtype), state) == jax.tree.map(
        lambda x: (x.shape, x.dtype), after
    )
    assert after.lineage.dtype == after.component.dtype == np.int32
    assert summary.status.dtype == summary.num_invalid.dtype == np.int32
    reported = summary.estimate, summary.log_evidence, summary.ess, summary.spread
    floats = {x.dtype for x in (after.lagged, after.log_weights, *reported)}
    assert len(floats) == 1
    return floats.pop()


@every_method
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
        (lambda: ordering.sir(3), {"resampling": "bootstrap"}, r"resampling='bootstrap'"),
        (lambda: ordering.sir(3), {"parents": (-1, 0)}, r"parents has 2 parts .* ordering has 3"),
        (lambda: ordering.sir(3), {"parents": (-1, 0, 7)}, r"parents\[2\]=7 is not a part"),
        (lambda: ordering.sir(3), {"initial": np.zeros(3)}, r"initial has shape \(3,\).*P = 3"),
        (lambda: ordering.sir(3), {"initial": np.zeros((2, 1))}, r"initial has shape \(2, 1\)"),
        (lambda: ordering.dps(3), {"num_particles": 2}, r"num_particles=2 is fewer than the 3"),
        (lambda: ordering.sir(3), {"num_particles": 0}, r"num_particles=0 is fewer than the 1"),
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
