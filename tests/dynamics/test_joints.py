"""Parts that hang on their parents: poses follow joints, and trees hold together."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

import scenes
from jaxpf.dynamics import RelativeToParent, UniformAround
from jaxpf.dynamics.joints import joints_between, substates_at
from jaxpf.shapes.rectangles import corners_from_poses

TREE = (-1, 0, 0, 1, 2)
#: Cross-shaped anchors, none of them zero, so that no rotation can be left out unnoticed.
PARENT_ANCHOR = np.array([[0, 0], [-15, 2], [15, -3], [-12, 1], [12, -1]], float)
PART_ANCHOR = np.array([[0, 0], [12, -2], [-12, 3], [11, 2], [-11, 1]], float)
SCALE = np.array([[2, 3, 0.05], [0.5, 0.4, 0.1], [0.5, 0.4, 0.1], [0.3, 0.2, 0.2], [1, 1, 1]])

propagate = jax.jit(RelativeToParent.propagate)
propagate_all = jax.jit(RelativeToParent.propagate_all)
substates_from = jax.jit(substates_at)


def dynamics(scale=SCALE, **changes):
    return RelativeToParent(
        scale=scale, parent_anchor=PARENT_ANCHOR, part_anchor=PART_ANCHOR, parents=TREE, **changes
    )


def joint_in_the_image(substate, part, parent):
    """The joint's place seen from the part and, offset included, from its parent."""

    def turned(vector, angle):
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ vector

    seen_from_part = substate[:2] + turned(PART_ANCHOR[part], substate[2])
    lever = PARENT_ANCHOR[part] + substate[3:5]
    return seen_from_part, parent[:2] + turned(lever, parent[2])


@pytest.mark.parametrize("part", [1, 2, 3, 4])
def test_a_moved_part_still_hangs_on_its_moved_parent(part):
    rng = np.random.default_rng(part)
    current, previous, parent = rng.normal(size=(3, 6)) * [40, 40, 2, 1, 1, 1]
    moved = propagate(dynamics(), jax.random.key(part), part, current, previous, parent)
    seen_from_part, seen_from_parent = joint_in_the_image(np.asarray(moved, float), part, parent)
    np.testing.assert_allclose(seen_from_part, seen_from_parent, atol=1e-4)
    np.testing.assert_allclose(moved[2], parent[2] + moved[5], atol=1e-5)


def test_without_noise_a_part_is_carried_by_its_parent():
    still = dynamics(scale=np.zeros((5, 3)), memory=0.5)
    poses = np.array([[100, 50, 0], [75, 49, 0.2], [126, 52, -0.3], [50, 45, 0.4], [150, 60, 0.1]])
    at = np.asarray(substates_from(still, poses))
    np.testing.assert_allclose(at[:, :3], poses, atol=1e-4)
    key, zeros = jax.random.key(0), np.zeros(6)
    np.testing.assert_allclose(propagate(still, key, 0, at[0], at[0], zeros), at[0], atol=1e-5)
    # The parent turns by a right angle about its own centre; half of the offset stays.
    parent = at[0] + [0, 0, np.pi / 2, 0, 0, 0]
    moved = propagate(still, key, 1, at[1], at[1], parent)
    np.testing.assert_allclose(moved[3:5], 0.5 * at[1, 3:5], atol=1e-4)
    np.testing.assert_allclose(moved[5], at[1, 5], atol=1e-6)
    full = propagate(dataclasses.replace(still, memory=1.0), key, 1, at[1], at[1], parent)
    x, y = poses[1, :2] - poses[0, :2]
    np.testing.assert_allclose(full[:2], poses[0, :2] + [-y, x], atol=1e-4)


def test_noise_has_the_stated_deviations():
    count, key = 20_000, jax.random.key(3)
    start = np.broadcast_to(np.array([10.0, 20, 0.3, 0, 0, 0.1])[:, None], (6, count))
    parent = np.broadcast_to(np.array([5.0, 5, 0.2, 0, 0, 0])[:, None], (6, count))
    for part in range(5):
        partition = np.full(count, part)
        moved = np.asarray(propagate_all(dynamics(), key, partition, start, start, parent))
        rows = moved[:3] if part == 0 else moved[3:]
        deviation = np.std(rows.astype(float), axis=1)
        np.testing.assert_allclose(deviation, SCALE[part], rtol=4 / np.sqrt(2 * count))
        correlation = np.corrcoef(rows) - np.eye(3)
        assert np.abs(correlation).max() < 4 / np.sqrt(count)
    root = propagate(dynamics(), key, 0, start[:, 0], start[:, 0], start[:, 0])
    assert not np.asarray(root)[3:].any()


def test_particles_of_different_parts_move_by_their_own_joints():
    rng = np.random.default_rng(1)
    current, parent = rng.normal(size=(2, 6, 5)).astype(np.float32)
    still = dynamics(scale=np.zeros((5, 3)))
    key = jax.random.key(0)
    mixed = propagate_all(still, key, np.arange(5), current, current, parent)
    each = [
        propagate(still, key, p, *(x[:, p] for x in (current, current, parent))) for p in range(5)
    ]
    np.testing.assert_allclose(mixed, np.stack(each, axis=1), atol=1e-5)


def test_parts_that_walk_alone_ignore_their_parents():
    rng = np.random.default_rng(2)
    current, parent = rng.normal(size=(2, 6, 5)).astype(np.float32)
    free = dynamics(scale=np.zeros((5, 3)), walks_alone=np.ones(5, bool))
    moved = propagate_all(free, jax.random.key(0), np.arange(5), current, current, parent)
    moved = np.asarray(moved)
    np.testing.assert_allclose(moved[:3], current[:3])
    assert not moved[3:].any()
    poses, shift = rng.normal(size=(5, 3)), np.arange(15.0).reshape(5, 3)
    at = np.asarray(substates_from(free, poses, shift=shift))
    np.testing.assert_allclose(at[:, :3], poses + shift, rtol=1e-5)
    assert not at[:, 3:].any()


def test_the_density_is_that_of_a_part_s_joint_and_of_a_root_s_pose():
    rng = np.random.default_rng(3)
    new, current, parent = rng.normal(size=(3, 6, 5)).astype(np.float32)
    found = dynamics(memory=0.4).log_density_all(np.arange(5), new, current, current, parent)
    expected = []
    for part in range(5):
        moved = new[:3, part] - current[:3, part]
        if TREE[part] >= 0:
            moved = new[3:, part] - np.array([0.4, 0.4, 1]) * current[3:, part]
        expected.append(norm.logpdf(moved, scale=SCALE[part]).sum())
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_gradients_are_finite_and_those_of_the_rotation():
    key, parent = jax.random.key(0), np.array([3.0, 4, 0.3, 0, 0, 0], np.float32)
    still = dynamics(scale=np.zeros((5, 3), np.float32))

    def end(angle):
        at = jnp.zeros(6).at[5].set(angle)
        moved = still.propagate(key, 1, at, at, parent)
        return moved, moved

    slope, moved = jax.device_get(jax.jit(jax.jacobian(end, has_aux=True))(0.2))
    # Turning about the joint moves the centre at right angles to the lever.
    joint = np.array(joint_in_the_image(moved.astype(float), 1, parent.astype(float))[0])
    lever = moved[:2] - joint
    np.testing.assert_allclose(slope[:2], [-lever[1], lever[0]], atol=1e-4)

    @jax.jit
    @jax.grad
    def of_total(model):
        return jnp.sum(model.propagate(jax.random.key(1), 1, moved, moved, parent))

    for leaf in jax.tree.leaves(of_total(still)):
        assert np.isfinite(leaf).all()


def test_the_scene_is_reached_by_its_own_joints():
    scene = scenes.make("articulated", 1, num_frames=3)
    extras = scene.extras
    model = RelativeToParent(
        scale=np.zeros((7, 3)),
        parent_anchor=extras["parent_anchors"],
        part_anchor=extras["part_anchors"],
        parents=extras["parents"],
    )
    at = np.asarray(substates_from(model, extras["poses"][0]))
    np.testing.assert_allclose(at[:, :3], extras["poses"][0], atol=1e-3)
    np.testing.assert_allclose(at[:, 3:5], 0, atol=1e-3)  # no offset: parts are attached
    corners = jax.jit(corners_from_poses)(extras["poses"], scene.sizes)
    np.testing.assert_allclose(corners, extras["corners"], atol=1e-3)


def test_guessed_joints_lie_at_the_near_end_of_a_part():
    # A trunk with an arm to its right, a forearm bent by a right angle, in any order.
    poses = np.array([[140, 30, np.pi / 2], [100, 20, 0], [120, 10, 0]])
    sizes = np.array([[30, 8], [20, 40], [20, 8]])
    parent_anchor, part_anchor = joints_between(poses, sizes, (2, -1, 1))
    np.testing.assert_allclose(part_anchor, [[-15, 0], [0, 0], [-10, 0]], atol=1e-5)
    # The forearm's upper end, (140, 15), from the arm's centre; the arm's left from the trunk's.
    np.testing.assert_allclose(parent_anchor, [[20, 5], [0, 0], [10, -10]], atol=1e-4)


def test_a_start_is_uniform_in_its_reach():
    poses, reach = np.array([[10.0, 20, 0.1], [50, 60, 0.2]]), np.array([4.0, 2, 0])
    keys = jax.random.split(jax.random.key(0), 4000)
    apart = np.asarray(jax.jit(jax.vmap(UniformAround(poses, reach)))(keys)) - poses
    assert (np.abs(apart) <= reach + 1e-5).all()
    np.testing.assert_allclose(apart.std(axis=0)[:, :2], [[4 / 3**0.5, 2 / 3**0.5]] * 2, rtol=0.05)
    assert abs(np.corrcoef(apart[:, 0, 0], apart[:, 1, 0])[0, 1]) < 0.07


def test_a_start_by_joints_holds_together():
    model = dynamics()
    poses = np.array([[100, 50, 0], [75, 49, 0.2], [126, 52, -0.3], [50, 45, 0.4], [150, 60, 0.1]])
    reach = np.broadcast_to(np.array([4, 4, 0.2]), (5, 3))
    sampler = UniformAround(jnp.array(poses, jnp.float32), reach, model)
    keys = jax.random.split(jax.random.key(0), 500)
    drawn = np.asarray(jax.jit(jax.vmap(sampler))(keys), float)
    for part, parent in enumerate(TREE):
        if parent >= 0:
            for one in drawn[:20]:
                places = joint_in_the_image(one[part], part, one[parent])
                np.testing.assert_allclose(*places, atol=1e-3)
    # The end of an arm adds up the freedom of all its joints.
    spread = drawn[..., :2].std(axis=0).sum(axis=1)
    assert spread[0] < spread[1] < spread[3]
    assert (np.abs(drawn[:, 0, :3] - poses[0]) <= np.array([4, 4, 0.2]) + 1e-4).all()
