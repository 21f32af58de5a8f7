"""Smoothing as a user meets it: shapes, what is refused, who goes together, fixed lags."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from models import partitioned
from unsuited_dynamics import Blind

import jaxpf
from jaxpf import ordering, pytree_dataclass, smoothing
from jaxpf.dynamics import AR2, IndependentGaussian, LinearGaussian, RandomWalk
from jaxpf.smoothing import backward, checks

KEY = jax.random.key(1)
FRAMES = np.random.default_rng(0).normal(size=(5, 2, 1)).astype(np.float32)


tracker = functools.partial(partitioned, dynamics=AR2(scale=1.0))


@pytree_dataclass
class OnePerParticle:
    """A motion of second order, written for one particle."""

    def propagate(self, key, partition, current, previous, parent):
        return current + 0.5 * (current - previous) + jax.random.normal(key, current.shape)

    def log_density(self, partition, new, current, previous, parent):
        return -0.5 * jnp.sum((new - current - 0.5 * (current - previous)) ** 2)


@pytest.fixture(scope="module")
def ran():
    """Particles and summaries of a run."""
    given = tracker(), KEY, FRAMES
    return jaxpf.run(*given, lambda state, summary: (state.substates, summary))[1]


@functools.cache
def smoothed(method):
    given = {} if method == "genealogy" else {"num_trajectories": 20}
    return jaxpf.smooth(tracker(), KEY, FRAMES, method=method, paths=20, **given)


@pytest.mark.slow
@pytest.mark.always
def test_moments_are_those_of_the_paths_and_the_filter_is_that_of_a_run(ran):
    found = smoothed("backward")
    np.testing.assert_allclose(found.paths.mean(0), found.estimate, atol=1e-6)
    np.testing.assert_allclose(found.paths.std(0), found.spread, atol=1e-6)
    # To rounding: on a GPU, what else is kept changes how a sum is compiled.
    np.testing.assert_allclose(found.summaries.estimate, ran[1].estimate, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [pytest.param("backward", marks=pytest.mark.always), "genealogy", "metropolis"]
)
def test_paths_go_through_particles_of_their_frames(method, ran):
    found = smoothed(method)
    for time in range(5):
        for part in range(2):
            held = set(np.asarray(ran[0][time, :, part, 0]).tolist())
            on_paths = np.asarray(found.paths[:, time, part, 0]).tolist()
            assert set(on_paths) <= held
            if method == "genealogy":
                assert len(set(on_paths)) <= found.num_ancestors[time, part] <= 30


def keep_sources(state, summary):
    return state.lagged[0], state.lagged[1], state.sources


@pytest.mark.slow
def test_ancestors_are_the_particles_that_were_moved():
    """With exchange each partition has its own."""
    its = tracker(ordering.sps([-1, -1]), keep_ancestors=True)
    keys = jax.random.split(jax.random.key(3), 2)
    kept = jaxpf.monte_carlo(its, keys, FRAMES, keep_sources)
    current, previous, sources = map(np.asarray, kept)  # [R, T, D, P, N]
    before = np.take_along_axis(current[:, :-1], sources[:, 1:, None], axis=-1)
    np.testing.assert_array_equal(before, previous[:, 1:])
    assert (sources[:, :, 0] != sources[:, :, 1]).any()


def test_the_genealogy_needs_no_density():
    its = tracker(dynamics=Blind())
    assert jax.eval_shape(lambda: jaxpf.smooth(its, KEY, FRAMES, method="genealogy")).paths is None


@pytest.mark.slow
@pytest.mark.always
def test_the_genealogy_ends_with_all_particles_and_counts_ancestors():
    found = smoothed("genealogy")
    assert (np.diff(found.num_ancestors, axis=0) >= 0).all()
    assert (found.num_ancestors[0] < 30).all()
    last = found.summaries.estimate[-1], found.summaries.spread[-1]
    np.testing.assert_allclose((found.estimate[-1], found.spread[-1]), last, rtol=1e-5)


def test_a_motion_written_for_one_particle_is_smoothed_alike():
    """Its density for all follows from that for one, see ``tests/contract/test_interface.py``."""
    found = jax.eval_shape(lambda: jaxpf.smooth(tracker(dynamics=OnePerParticle()), KEY, FRAMES))
    assert found.estimate.shape == (5, 2, 1)


@pytest.mark.parametrize(
    ("dynamics", "expected"),
    [
        (RandomWalk(1.0), False),
        (AR2(1.0), True),
        (LinearGaussian(np.ones((2, 1, 1)), np.ones((2, 1, 1))), False),
        (LinearGaussian(np.ones((2, 1, 1)), np.ones((2, 1, 1)), lag=np.ones((2, 1, 1))), True),
        (OnePerParticle(), True),
    ],
)
def test_it_is_known_who_looks_two_frames_back(dynamics, expected):
    assert checks.looks_back(tracker(dynamics=dynamics)) is expected


def partitions(its):
    return [parts.tolist() for parts, _ in backward.groups_of(its)]


def test_independent_objects_go_apart_and_trees_together():
    assert partitions(tracker()) == [[[0], [1]]]
    forest = (-1, 0, -1, 2, -1)
    its = tracker(ordering.ps(range(5)), parents=forest)
    assert partitions(its) == [[[0, 1], [2, 3]], [[4]]]
    parents = [[[-1, 0], [-1, 0]], [[-1]]]
    assert [of_parts.tolist() for _, of_parts in backward.groups_of(its)] == parents


def test_whatever_is_not_known_to_be_independent_goes_together():
    seen_jointly = tracker(likelihood=CorrelatedGaussian(jnp.eye(2)))
    labelled = tracker(initial_label=jnp.array([0.5, 0.5]))
    drawn = tracker(initial=jax.tree_util.Partial(lambda key: jax.random.normal(key, (2, 1))))
    for its in (seen_jointly, labelled, drawn):
        assert partitions(its) == [[[0, 1]]]
    apart = IndependentGaussian(np.zeros((2, 1)), 1.0)
    assert partitions(tracker(initial=apart)) == [[[0], [1]]]


@pytest.mark.slow
@pytest.mark.always
def test_frames_come_one_by_one_with_a_lag(ran):
    its, key = tracker(), KEY
    streamed = list(smoothing.smooth_stream(its, key, iter(FRAMES), 2))
    assert [frame.time for frame in streamed] == [0, 1, 2, 3, 4]
    whole = jaxpf.smooth(its, key, FRAMES, lag=2)
    np.testing.assert_array_equal(whole.estimate, [frame.estimate for frame in streamed])
    np.testing.assert_allclose(whole.summaries.estimate, ran[1].estimate, atol=1e-5)


def kept(**changes):
    return tracker(**{"resampling": "multinomial", "num_particles": 6} | changes)


@pytest.mark.slow
def test_sweeps_go_on_from_their_reference_and_over_missing_frames():
    frames = FRAMES.copy()
    frames[2:4] = np.nan
    drawn = smoothing.particle_gibbs(kept(), KEY, frames, 3)
    assert drawn.shape == (3, 6, 2, 1)
    assert jnp.isfinite(drawn).all()
    assert not jnp.array_equal(drawn[0, 1:], drawn[2, 1:])
    assert (drawn[:, 0] == 0).all()  # where all particles start
    again = jax.eval_shape(lambda: smoothing.particle_gibbs(kept(), KEY, frames, 3, drawn[-1]))
    assert again.shape == drawn.shape
