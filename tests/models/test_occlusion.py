"""The label of depth: kept while shapes overlap, flipped now and then while they do not."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import pytree_dataclass
from jaxpf.dynamics import FLIP, RandomWalk, WithOcclusion

RUNS = 40_000


@pytree_dataclass
class Discs:
    """Two discs of radius 1."""

    def overlap(self, substates):
        return jnp.abs(substates[0, 0] - substates[1, 0]) < 2


DYNAMICS = WithOcclusion(RandomWalk(scale=0.5), Discs())


def flips(distance, label):
    """Share of the draws that end with the other label."""
    substates = jnp.array([[0.0], [distance]])
    keys = jax.random.split(jax.random.key(label), RUNS)
    moved = jax.vmap(DYNAMICS.propagate_label, in_axes=(0, None, None))(keys, label, substates)
    return float(jnp.mean(moved != label))


def test_the_label_is_kept_while_shapes_overlap():
    assert flips(1.0, 0) == flips(1.5, 1) == 0


def test_the_label_flips_with_a_small_probability_while_they_are_apart():
    error = np.sqrt(FLIP * (1 - FLIP) / RUNS)
    for label in (0, 1):
        assert abs(flips(3.0, label) - FLIP) < 4.5 * error


def test_substates_move_as_without_occlusion():
    arguments = jax.random.key(3), jnp.zeros(4, int), *[jnp.ones((2, 4))] * 3
    np.testing.assert_array_equal(
        DYNAMICS.propagate_all(*arguments), DYNAMICS.dynamics.propagate_all(*arguments)
    )


def test_the_density_of_a_move_and_of_a_flip():
    arguments = jnp.zeros(4, int), *[jnp.ones((2, 4))] * 4
    np.testing.assert_array_equal(
        DYNAMICS.log_density_all(*arguments), DYNAMICS.dynamics.log_density_all(*arguments)
    )
    near, far = jnp.array([[0.0], [1.0]]), jnp.array([[0.0], [3.0]])
    for substates, flip in ((near, 0.0), (far, FLIP)):
        for label in (0, 1):
            same = DYNAMICS.log_label(label, label, substates)
            other = DYNAMICS.log_label(1 - label, label, substates)
            np.testing.assert_allclose(jnp.exp(jnp.array([same, other])), [1 - flip, flip])
