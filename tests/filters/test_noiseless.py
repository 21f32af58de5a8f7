"""Motion without noise in some coordinate: refused where a density that leaves it out is wrong."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import norm
from models import partitioned
from refusals import message_of

import jaxpf
from jaxpf import contract, ordering, proposals, pytree_dataclass
from jaxpf.dynamics import FirstOrder, RandomWalk
from jaxpf.likelihoods import Gaussian

KEY = jax.random.key(0)
FRAMES = np.random.default_rng(0).normal(size=(4, 1, 2)).astype(np.float32)
FIXED_SIZE = RandomWalk(np.array([1.0, 0.0], np.float32))
LOCALLY_OPTIMAL = proposals.LocallyOptimal()


def of_frames(dynamics=FIXED_SIZE, **options):
    likelihood = Gaussian(noise=0.7 * np.eye(2, dtype=np.float32)[None])
    settings = {"dynamics": dynamics, "likelihood": likelihood, "num_particles": 20}
    return partitioned(ordering.sir(1), dimension=2, **settings | options)


def residual(observation, partition, substate):
    return (observation[partition] - substate) / 0.7


@pytest.mark.parametrize(
    "proposal",
    [LOCALLY_OPTIMAL, proposals.Linearised(residual), proposals.Mixture(LOCALLY_OPTIMAL)],
)
def test_a_normal_proposal_would_move_what_the_motion_cannot(proposal):
    assert "coordinate 1 of partition 0" in message_of(of_frames, proposal=proposal)
    of_frames(RandomWalk(np.ones(2, np.float32)), proposal=proposal)


def test_such_a_proposal_gives_no_number_where_the_noise_is_traced():
    @jax.jit
    def traced(scale):
        its = of_frames(RandomWalk(jnp.stack([1.0, scale])), proposal=LOCALLY_OPTIMAL)
        summary = jaxpf.run(its, KEY, FRAMES)[1]
        return summary.log_evidence, summary.status

    log_evidence, status = traced(0.0)
    assert np.isnan(log_evidence).all()
    assert (status & contract.STATUS_UNSUPPORTED).all()
    assert np.isfinite(traced(1.0)[0]).all()


@pytree_dataclass
class Shrinking(contract.Dynamics):
    """A random walk whose noise in the second coordinate ends after two frames."""

    def at_frame(self, time):
        return RandomWalk(jnp.stack([1.0, jnp.where(time < 2, 1.0, 0.0)]))


def test_noise_that_ends_on_the_way_ends_the_evidence():
    summary = jaxpf.run(of_frames(Shrinking(), proposal=LOCALLY_OPTIMAL), KEY, FRAMES)[1]
    assert np.isfinite(summary.log_evidence[:2]).all()
    assert np.isneginf(summary.log_evidence[2:]).all()


def moving(speed, **options):
    """Position and velocity, with noise on the velocity alone."""
    return jaxpf.state_space(
        initial=np.zeros(2, np.float32),
        transition=lambda key, x, p: jnp.stack([x[0] + p * x[1], x[1] + jax.random.normal(key)]),
        transition_log_density=lambda new, x, p: norm.logpdf(new[1], x[1]),
        log_likelihood=lambda y, x, p: norm.logpdf(y, x[0]),
        parameters=speed,
        num_particles=20,
        **options,
    )


def test_the_score_would_miss_parameters_that_act_through_it():
    named = "coordinate 0 of partition 0"
    assert named in message_of(moving, 1.0, motion_gradient="score")
    moving(1.0)
    frames = FRAMES[:, 0, 0]
    traced = jax.jit(lambda a: jaxpf.run(moving(a, motion_gradient="score"), KEY, frames)[1])
    assert np.isnan(traced(1.0).log_evidence).all()


def test_the_score_is_right_where_such_a_coordinate_stays():
    of_frames(motion_gradient="score")


@pytest.mark.parametrize("num_values", [None, 2])
def test_integers_have_probabilities_in_place_of_noise(num_values):
    jaxpf.state_space(
        initial=jnp.int32(0),
        transition=lambda key, x, p: jax.random.bernoulli(key, 0.5).astype(jnp.int32),
        transition_log_density=lambda new, x, p: jnp.log(jnp.array([0.5, 0.5]))[new],
        log_likelihood=lambda y, x, p: norm.logpdf(y, x),
        num_values=num_values,
        motion_gradient="score",
    )


def test_a_drift_would_move_places_that_cannot():
    start = np.array([[0, 0, 1, 0], [3, 0, 1, 0]], np.float32)
    seen = np.tile(np.eye(2, 4, dtype=np.float32), (2, 1, 1))
    likelihood = Gaussian(noise=np.tile(np.eye(2, dtype=np.float32), (2, 1, 1)), observation=seen)

    def proper(noise, **options):
        scale = np.array([noise, noise, 0.3, 0.3], np.float32)
        return jaxpf.Eskil(FirstOrder(scale), likelihood, start, proper=True, **options)

    assert "coordinate 0 of partition 0" in message_of(proper, 0.0)
    proper(0.0, drift="none")
    proper(0.5)
