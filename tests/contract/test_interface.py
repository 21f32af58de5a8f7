"""A class offers what it defines, in all forms that follow from it."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf import contract, pytree_dataclass
from jaxpf.contract import calls
from jaxpf.parts.models import OfFixedSize

OBSERVATION = jnp.array([[1.0, 2.0], [3.0, 4.0]])
#: (x, y, theta, joint ...) of two particles.
SUBSTATES = jnp.array([[1.0, 5.0], [2.0, 6.0], [0.1, 0.2], [7.0, 7.0]])
PARTITION = jnp.array([0, 1])


@pytree_dataclass
class OfOneParticle:
    """The least that is a likelihood, of (u, v, scale, theta)."""

    def observe(self, frame):
        return 2 * frame

    def log_prob(self, observation, partition, substate):
        return jnp.sum(observation[partition] * substate[:2]) + 10 * substate[2] + substate[3]


@pytree_dataclass
class OfAll:
    """The same for all particles at once."""

    def observe(self, frame):
        return 2 * frame

    def log_prob_all(self, observation, partition, substates):
        return (
            jnp.sum(observation[partition].T * substates[:2], 0) + 10 * substates[2] + substates[3]
        )


EXPECTED = [1 * 1 + 2 * 2 + 10 + 0.1, 3 * 5 + 4 * 6 + 10 + 0.2]


@pytest.mark.parametrize("inner", [OfOneParticle(), OfAll()])
def test_a_wrapper_weighs_as_the_wrapped_likelihood_in_whichever_form_that_is_written(inner):
    wrapped = OfFixedSize(inner)
    every = wrapped.log_prob_all(OBSERVATION, PARTITION, SUBSTATES)
    np.testing.assert_allclose(every, EXPECTED, rtol=1e-6)
    one = wrapped.log_prob(OBSERVATION, PARTITION[1], SUBSTATES[:, 1])
    np.testing.assert_allclose(one, EXPECTED[1], rtol=1e-6)
    np.testing.assert_array_equal(wrapped.observe(OBSERVATION), 2 * OBSERVATION)


# Who inherits is given what follows from the rest.


@pytree_dataclass
class OneForm(contract.DynamicsWithDensity):
    """Written for one particle."""

    def propagate(self, key, partition, current, previous, parent):
        return current + partition + jax.random.normal(key, current.shape)

    def log_density(self, partition, new, current, previous, parent):
        return -0.5 * jnp.sum((new - current - partition) ** 2)


def test_the_form_for_all_particles_follows_from_that_for_one():
    current = jnp.arange(6.0).reshape(2, 3)
    partition = jnp.array([0, 1, 1])
    key = jax.random.key(1)
    moved = OneForm().propagate_all(key, partition, current, current, current)
    keys = jax.random.split(key, 3)
    for i in range(3):
        alone = OneForm().propagate(keys[i], partition[i], *[current[:, i]] * 3)
        np.testing.assert_allclose(moved[:, i], alone, rtol=1e-6)
    density = OneForm().log_density_all(partition, moved, current, current, current)
    expected = -0.5 * np.sum((np.asarray(moved) - current - partition) ** 2, axis=0)
    np.testing.assert_allclose(density, expected, rtol=1e-6)


def test_likelihoods_that_factor_have_no_log_joint():
    assert not calls.has_log_joint(contract.Likelihood())
    assert not calls.has_log_density(contract.Dynamics())


def test_a_declared_error_is_for_every_partition_or_a_row_for_each():
    def declared(error):
        likelihood = type("Declaring", (), {"model_error": error})()
        return calls.model_error(SimpleNamespace(likelihood=likelihood), 2)

    np.testing.assert_array_equal(declared((1, 2, 0.5)), [[1, 2, 0.5]] * 2)
    rows = [[1, 2, 0.5], [3, 4, 0]]
    np.testing.assert_array_equal(declared(jnp.array(rows)), rows)
    np.testing.assert_array_equal(calls.model_error(SimpleNamespace(), 2), np.zeros((2, 3)))
