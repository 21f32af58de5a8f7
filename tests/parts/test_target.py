"""Trackers of articulated objects: they follow the scene, and refuse what they cannot track."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import every, message_of

import jaxpf
import scenes
from jaxpf.contract.calls import has_log_odds
from jaxpf.likelihoods import histogram_from_patches
from jaxpf.ordering import SWAPS, named
from jaxpf.parts.models import OfFixedSize, parts_model, with_log_odds
from jaxpf.shapes.rectangles import corners_from_poses

TREE = (-1, 0, 0, 1, 2)


def seen(part, frame, numbers, states):
    return part.log_odds_all(part.observe(frame), numbers, states)


log_odds = jax.jit(seen)


@pytest.fixture(scope="module")
def scene():
    return scenes.make("articulated", 1, num_parts=5, num_frames=16)


@pytest.fixture(scope="module")
def likelihood(scene):
    return histogram_from_patches(
        scene.patches, sharpness=50.0, bands=1, method="sampled", samples=10
    )


def tracker_of(scene, likelihood, ordering, **changes):
    settings = {
        "anchors": (scene.extras["parent_anchors"], scene.extras["part_anchors"]),
        "reach": (3, 3, 0.05),
    }
    start = scene.extras["poses"][0]
    return build(
        likelihood, start, scene.sizes, scene.extras["parents"], ordering, **(settings | changes)
    )


def mean_corner_distance(scene, summary):
    corners = corners_from_poses(summary.estimate, scene.sizes)
    return float(np.mean(np.linalg.norm(corners - scene.extras["corners"][1:], axis=-1)))


@pytest.mark.slow
@pytest.mark.parametrize("dynamics", ["relative", "absolute"])
def test_every_ordering_follows_the_object(scene, likelihood, dynamics):
    orderings = {"ps": named("ps", TREE)}
    orderings |= {swap: named("sps", TREE, swap=swap) for swap in SWAPS}
    keys = jax.random.split(jax.random.key(0), 6)
    for name, ordering in orderings.items():
        tracker = tracker_of(scene, likelihood, ordering, dynamics=dynamics)
        summary = jaxpf.monte_carlo(tracker, keys, scene.frames[1:], batch_size=6)
        error = mean_corner_distance(scene, summary)
        assert error < 4, f"{name}: {error:.2f} pixels"
        assert (np.asarray(summary.status) == 0).all()


def test_a_start_without_reach_has_every_particle_at_the_poses(scene, likelihood):
    for dynamics in ("relative", "absolute"):
        ordering = named("sps", TREE)
        tracker = tracker_of(scene, likelihood, ordering, dynamics=dynamics, reach=0)
        start = tracker.init(jax.random.key(0)).substates[..., :3]
        expected = np.broadcast_to(scene.extras["poses"][0], start.shape)
        np.testing.assert_allclose(start, expected, atol=1e-3)


@pytest.mark.slow
def test_a_part_of_fixed_size_is_a_box_of_scale_one(scene, likelihood):
    part = OfFixedSize(likelihood)
    observation = part.observe(scene.frames[0])
    poses = jnp.array(scene.extras["poses"][0].T, jnp.float32)
    poses = jnp.concatenate([poses, jnp.full((3, 5), 7.0)])  # a joint, which is not looked at
    every = part.log_prob_all(observation, jnp.arange(5), poses)
    boxes = jnp.stack([poses[0], poses[1], jnp.ones(5), poses[2]])
    np.testing.assert_allclose(every, likelihood.log_prob_all(observation, jnp.arange(5), boxes))
    one = part.log_prob(observation, 3, poses[:, 3])
    np.testing.assert_allclose(one, every[3], rtol=1e-5)


@pytest.mark.parametrize("kind", [pytest.param("patches", marks=pytest.mark.slow), "histograms"])
def test_log_odds_fall_where_a_part_is_not(scene, likelihood, kind):
    poses, frame = scene.extras["poses"][0], scene.frames[0]
    learned = likelihood
    if kind == "patches":
        learned = jaxpf.likelihoods.patch(frame, poses, scene.sizes, window=(12, 12))
    part = with_log_odds(learned, frame, poses, scene.sizes, TREE)
    there = np.asarray(poses.T, np.float32)
    assert np.all(log_odds(part, frame, np.arange(5), there) > 1)
    assert np.all(log_odds(part, frame, np.arange(5), there + np.float32([[60], [0], [0]])) < 0)
    assert not has_log_odds(OfFixedSize(learned))
    assert parts_model(part, poses, scene.sizes, TREE).likelihood is part


def test_a_part_torn_off_its_parent_is_doubtful_though_it_matches(scene, likelihood):
    poses, frame = scene.extras["poses"][0], scene.frames[0]
    part = with_log_odds(likelihood, frame, poses, scene.sizes, TREE)
    torn = dataclasses.replace(part, lengths=part.lengths.at[2].multiply(3.0))
    numbers, states = np.array([3, 2, 0, 4, 1]), np.asarray(poses.T, np.float32)
    whole = log_odds(part, frame, np.arange(5), states)
    mixed = log_odds(part, frame, numbers, states[:, numbers])
    np.testing.assert_allclose(mixed, whole[numbers], rtol=1e-5)
    worse = whole - log_odds(torn, frame, np.arange(5), states)
    slope = jax.jit(jax.grad(lambda x: seen(part, frame, np.arange(5), x).sum()))(states)
    assert np.isfinite(slope).all()
    # Stretch 2/3 instead of 0, so log odds lower by 1.6 log((2/3 + .05) / .05).
    np.testing.assert_allclose(worse, [0, 0, 1.6 * np.log(43 / 3), 0, 0], atol=1e-4)


def test_filmed_parts_slip_by_six_tenths_of_their_median_shorter_side(scene):
    given = jaxpf.parts.Parts(tuple("abcde"), TREE, scene.extras["poses"][0], scene.sizes)
    tracker = jaxpf.parts.tracker(scene.frames[0], given, num_particles=10)
    slip = 0.6 * np.median(scene.sizes.min(axis=1))
    np.testing.assert_allclose(tracker.likelihood.model_error, [slip, slip, 0], rtol=1e-6)
    tracker = jaxpf.parts.tracker(scene.frames[0], given, num_particles=10, slip=0)
    np.testing.assert_allclose(tracker.likelihood.model_error, 0)


def test_orders_put_parents_first_whatever_the_numbering():
    tree = (2, -1, 1, 0)
    for method in ("sir", "ps", "sps"):
        assert named(method, tree).order[0].tolist() == [1, 2, 0, 3]
    assert not named("sir", tree).resample_after.any()
    assert named("ps", tree).resample_after.tolist() == [True, True, True, False]
    arms = named("sps", TREE)
    assert arms.resample_after.tolist() == [True, False, True, False, False]


POSES, SIZES = np.zeros((5, 3)), np.ones((5, 2))


def build(likelihood=None, poses=POSES, sizes=SIZES, tree=TREE, ordering=None, **settings):
    model = parts_model(likelihood, poses, sizes, tree, **settings)
    ordering = ordering or named("ps", TREE)
    return jaxpf.Partitioned(**model._asdict(), ordering=ordering, num_particles=60)


@every(
    [
        (lambda: named("dps", TREE), "'dps'"),
        (lambda: named("ps", (-1, 2, 1)), "1 on 2 on 1"),
        (lambda: named("ps", (-1, 7)), "parents[1]=7"),
        (lambda: jaxpf.parts.Parts("abcde", TREE, POSES, SIZES * [1, 0]), "sizes"),
        (lambda: jaxpf.parts.Parts("abcde", TREE, POSES + np.nan, SIZES), "poses"),
        (lambda: build(joint_scale=(1, 1, -1)), "joint_scale"),
        (lambda: build(reach=np.inf), "reach"),
    ]
)
def test_what_cannot_be_tracked_is_refused(call, named):
    assert named in message_of(call)
