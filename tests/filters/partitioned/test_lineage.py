"""Labels made at run time, and exchanges that stay within a lineage."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tagged_walk import (
    D,
    N,
    P,
    frames,
    track,
    tracker,
)

from jaxpf import ordering, pytree_dataclass

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
