"""The expected gradient of the evidence against that of the Kalman filter.

``stop_gradient`` must agree at any number of particles, for every method, and without any
gradient of the choices it must not; how far is printed.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, TREE, WRONG, problem
from kalman_gradients import gradients

from jaxpf import ordering, pytree_dataclass
from jaxpf.gradients import NoGradient, StopGradient
from jaxpf.likelihoods import Gaussian
from jaxpf.proposals import LocallyOptimal, Mixture

pytestmark = pytest.mark.statistical


def told(*arguments, **settings):
    """The gradients; how far they are off is printed."""
    found = gradients(*arguments, **settings)
    print(found)
    return found


METHODS = {
    "sir": ordering.sir(3),
    "ps": ordering.ps([0, 2, 1]),
    "dps": ordering.dps(orders=[[0, 1, 2], [0, 2, 1]]),
    "sps-combinatorial": ordering.sps(TREE),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_stop_gradient_is_unbiased_on_a_part_tree(method):
    found = told(problem(TREE), METHODS[method], gradient=StopGradient())
    assert found.worst < LIMIT


@pytest.mark.slow
def test_stop_gradient_is_unbiased_where_roots_are_exchanged():
    """The past of an object must bring its derivative along: groups here have many pasts."""
    exact = problem((-1, -1), transition=0.7, lag=0.3, initial_scale=1.0)
    found = told(exact, ordering.sps(num_partitions=2), gradient=StopGradient())
    assert found.worst < LIMIT


@pytree_dataclass
class CorrectedAtTheEnd:
    """``Gaussian`` whose partitions are weighed by too broad a noise; ``log_joint`` is right."""

    noise: Any

    state_gradient = True

    def observe(self, frame):
        return frame

    def log_prob_all(self, observation, partition, substates):
        return Gaussian(noise=1.5 * self.noise).log_prob_all(observation, partition, substates)

    def log_prob(self, observation, partition, substate):
        return self.log_prob_all(observation, jnp.asarray(partition)[None], substate[:, None])[0]

    def log_joint(self, observation, substates, log_probs):
        every = jnp.arange(len(substates))
        right = Gaussian(noise=self.noise)
        return jnp.sum(right.log_prob_all(observation, every, substates.T))


@pytest.mark.slow
def test_stop_gradient_is_unbiased_where_weights_stay_unequal():
    """Not always resampled, by tempered weights, and corrected by ``log_joint`` in the end."""
    exact = problem(TREE)
    exact = exact._replace(likelihood=CorrectedAtTheEnd(noise=exact.likelihood.noise))
    method, settings = METHODS["dps"], {"ess_threshold": 0.5, "tempering": 0.5}
    found = told(exact, method, gradient=StopGradient(), **settings)
    assert found.worst < LIMIT


@pytest.mark.slow
def test_stop_gradient_is_unbiased_with_joint_weighting():
    """The weights' derivative flows through the predictions of later objects, too."""
    exact = problem((-1, -1))
    exact = exact._replace(likelihood=CorrectedAtTheEnd(noise=exact.likelihood.noise))
    settings = {"gradient": StopGradient(), "joint_weighting": True, "runs": 10_000}
    found = told(exact, ordering.dps(2), **settings)
    assert found.worst < LIMIT
    blind = gradients(exact, ordering.dps(2), **settings | {"gradient": NoGradient()})
    assert np.abs(blind.z).max() > WRONG


VARIATIONS = {
    "stop_gradient": ({"gradient": StopGradient()}, True),
    "stop_gradient, score": ({"gradient": StopGradient(), "motion_gradient": "score"}, True),
    "proposal": ({"gradient": StopGradient(), "proposal": Mixture(LocallyOptimal())}, True),
    "proposal, score": (
        {"gradient": StopGradient(), "motion_gradient": "score", "proposal": LocallyOptimal()},
        True,
    ),
    "none": ({"gradient": NoGradient()}, False),
}


@pytest.mark.parametrize(
    "variation",
    [pytest.param(x, marks=[pytest.mark.slow] * (x != "stop_gradient")) for x in VARIATIONS],
)
def test_bias_of_every_variation_on_one_partition(variation):
    settings, unbiased = VARIATIONS[variation]
    found = told(problem((-1,)), ordering.ps([0]), **settings)
    if unbiased:
        assert found.worst < LIMIT
    else:
        assert np.abs(found.z).max() > 2 * WRONG  # so the test can tell
    assert np.isfinite(found.gradient).all()
