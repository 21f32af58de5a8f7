"""Proposals against the Kalman filter: any of them leaves the filter unbiased, good ones pay."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import (
    LIMIT,
    OBJECTS,
    QUICK_RUNS,
    TREE,
    monte_carlo_once,
    objects,
    problem,
    record_runs,
    scores,
)
from proposed import Bad, residual

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass
from jaxpf.dynamics import RandomWalk
from jaxpf.proposals import Linearised, LocallyOptimal, Mixture

pytestmark = pytest.mark.statistical

PROPOSALS = {
    "optimal": LocallyOptimal(),
    "linearised": Linearised(residual),
    "mixture": Mixture(Bad(), 0.7),
    "bad": Bad(),
}
ON_A_TREE = {
    "sir": ordering.sir(3),
    "ps": ordering.ps([0, 2, 1]),
    "dps": ordering.dps(orders=[[0, 1, 2], [0, 2, 1]]),
    "sps": ordering.sps(TREE),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", ON_A_TREE)
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.always] * (n == "optimal")) for n in PROPOSALS],
)
def test_filter_on_a_part_tree_with_a_missing_frame_is_unbiased(name, method):
    exact = problem(TREE, num_frames=4, missing=(1,))
    found = scores(exact, ON_A_TREE[method], proposal=PROPOSALS[name], runs=QUICK_RUNS)
    assert found.worst < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linearised", "bad"])
@pytest.mark.parametrize("method", ["ps", "sps"])
def test_filter_with_missing_partitions_is_unbiased(name, method):
    """A root that is hidden, a leaf, and a whole frame."""
    exact = problem(TREE, num_frames=4, missing=(2,), hidden=((0, 1), (1, 0), (3, 2)))
    assert scores(exact, ON_A_TREE[method], proposal=PROPOSALS[name]).worst < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dps", "sps"])
def test_second_order_objects_are_unbiased(method):
    order = ordering.dps(4) if method == "dps" else ordering.sps(OBJECTS)
    settings = {"ess_threshold": 0.7} if method == "dps" else {}
    assert scores(objects(), order, proposal=LocallyOptimal(), **settings).worst < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("joint_weighting", [False, True])
def test_joint_likelihood_is_unbiased(joint_weighting):
    exact = problem(OBJECTS, correlation=0.5)
    order = ordering.ps([0, 1, 2, 3])
    found = scores(
        exact, order, proposal=Mixture(Linearised(residual)), joint_weighting=joint_weighting
    )
    assert found.worst < LIMIT


@pytest.mark.slow
def test_optimal_proposal_pays_where_observations_are_precise():
    exact = problem(TREE, num_frames=4, missing=(1,))  # the kernel of the test above
    precise = dataclasses.replace(exact.likelihood, noise=0.1 * np.ones((3, 1, 1)))

    def variance(**settings):
        recorded = record_runs(
            exact._replace(likelihood=precise), ON_A_TREE["ps"], runs=2_000, **settings
        )
        return recorded[0].sum(axis=1).var()

    assert variance(run=monte_carlo_once) > 10 * variance(proposal=LocallyOptimal())


@pytest.mark.slow
def test_a_missing_frame_moves_by_the_dynamics():
    exact = problem(TREE, num_frames=2, missing=(0, 1))
    once = jax.jit(jaxpf.run)
    made = [
        once(exact.tracker(ON_A_TREE["ps"], **settings), jax.random.key(0), exact.frames)[1]
        for settings in ({}, {"proposal": Bad()})
    ]
    np.testing.assert_array_equal(made[0].estimate, made[1].estimate)
    assert not np.asarray(made[1].log_evidence).any()


@pytest.mark.slow
def test_a_forecast_moves_by_the_dynamics():
    exact = problem(TREE)
    tracker = exact.tracker(ON_A_TREE["sps"], proposal=Bad())
    key, state = jax.random.key(1), tracker.init(jax.random.key(0))
    ahead = [
        jaxpf.forecast(chosen, key, state, 2)[1].estimate
        for chosen in (tracker, dataclasses.replace(tracker, proposal=None))
    ]
    np.testing.assert_array_equal(*ahead)


def test_linearised_is_optimal_for_a_linear_gaussian_model():
    exact = problem(TREE, lag=0.2)
    rng, partition = np.random.default_rng(0), jnp.array([0, 1, 2, 1])
    new, *past = jnp.asarray(rng.normal(size=(4, 1, 4)))

    @jax.jit
    def density(proposal):
        proposal = proposal.of_model(exact.dynamics, exact.likelihood)
        return proposal.log_density_all(jnp.asarray(exact.frames[0]), partition, new, *past)

    np.testing.assert_allclose(density(Linearised(residual)), density(LocallyOptimal()), rtol=1e-10)
    # And the weights of a mixture are bounded, whatever the other proposal does.
    thin = Mixture(Bad(scale=0.01), 0.8).of_model(exact.dynamics, exact.likelihood)
    move = partition, 3 * new, *past
    log_weight = exact.dynamics.log_density_all(*move) - thin.log_density_all(None, *move)
    assert (log_weight <= -np.log(1 - 0.8) + 1e-12).all()


def of_angle(observation, partition, substate):
    """Residual of the angle at which a point of the plane is seen."""
    return (observation[partition] - jnp.arctan2(substate[1], substate[0])[None]) / 0.01


@pytree_dataclass
class Bearing(jaxpf.contract.Likelihood):
    """A point of the plane is seen at an angle, with noise."""

    def log_prob(self, observation, partition, substate):
        return -0.5 * jnp.sum(of_angle(observation, partition, substate) ** 2)


@pytest.mark.slow
def test_linearised_helps_where_observations_are_not_linear():
    frames = np.linspace(0.4, 0.9, 6)[:, None, None]
    keys = jax.random.split(jax.random.key(3), 400)

    def log_evidence(**settings):
        tracker = jaxpf.Partitioned(
            dynamics=RandomWalk(0.3),
            likelihood=Bearing(),
            ordering=ordering.ps([0]),
            initial=np.array([[2.0, 1.0]]),
            num_particles=100,
            **settings,
        )
        found = monte_carlo_once(tracker, keys, frames, record=lambda _, s: s.log_evidence)
        return np.asarray(found).sum(axis=1)

    blind, proposed = log_evidence(), log_evidence(proposal=Mixture(Linearised(of_angle)))
    assert blind.var() > 3 * proposed.var()
    ratio = np.exp(blind) - np.exp(proposed).mean()
    assert abs(ratio.mean()) < LIMIT * np.exp(blind).std() / len(keys) ** 0.5


def test_a_share_of_all_is_refused():
    with pytest.raises(InputError, match="share"):
        Mixture(Bad(), 1.0)
