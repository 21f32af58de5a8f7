"""The auxiliary particle filter: unbiased; less variable with good first-stage weights."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, WRONG, problem
from jax.scipy.stats import norm
from models import log_density, space
from records import z_score

import jaxpf
from jaxpf.filters.partitioned import selection
from jaxpf.likelihoods import Gaussian, kalman
from jaxpf.resampling import SCHEMES

KEY = jax.random.key(7)
FRAMES = np.array([0.5, 2.5, np.nan, -3.0, 1.0])
A, S, NOISE = 0.9, 1.0, 0.5


def predictive(y, x, p):
    return norm.logpdf(y, A * x, (S**2 + NOISE**2) ** 0.5)


def residual(y, partition, x):
    return (y - x) / NOISE


def walk(**changes):
    settings = {
        "parameters": {"a": A, "s": S, "noise": NOISE},
        "transition_log_density": log_density,
        "first_stage": predictive,
        "num_particles": 12,
    }
    return space(**settings | changes)


def scores(tracker, num_runs=4000):
    """z-scores of evidence and of the means that it weights, by frame."""
    log_evidence, means, _ = kalman(
        np.eye(1) * A, np.eye(1) * S**2, np.eye(1), np.eye(1) * NOISE**2,
        np.zeros(1), np.eye(1) * S**2, FRAMES[:, None],
    )  # fmt: skip
    runs = jaxpf.monte_carlo(tracker, jax.random.split(KEY, num_runs), FRAMES, batch_size=2000)
    ratio = np.exp(np.cumsum(np.asarray(runs.log_evidence, float) - log_evidence, axis=1))
    parts = ratio * np.asarray(runs.estimate)[..., 0, 0]
    return np.abs(
        [
            (x.mean(0) - exact) / (x.std(0) / num_runs**0.5 + 1e-12)
            for x, exact in ((ratio, 1), (parts, means[:, 0]))
        ]
    ).max()


@pytest.mark.parametrize(
    "scheme",
    [pytest.param(x, marks=[pytest.mark.slow] * (x != "systematic")) for x in SCHEMES],
)
def test_evidence_is_unbiased(scheme):
    assert scores(walk(resampling=scheme)) < LIMIT


@pytest.mark.slow
@pytest.mark.always
def test_first_stage_weights_that_are_not_divided_out_are_noticed(monkeypatch):
    resample = selection.resample

    def undivided(tracker, key, log_weights, by, *rest):
        return resample(tracker, key, by, by, *rest)

    monkeypatch.setattr(selection, "resample", undivided)
    jax.clear_caches()  # else the program of the test above would run
    try:
        assert scores(walk()) > WRONG
    finally:
        jax.clear_caches()


@pytest.mark.slow
@pytest.mark.parametrize(
    "first_stage", [lambda y, x, p: -jnp.inf, lambda y, x, p: 1.5 * jnp.sin(9 * x)]
)
@pytest.mark.parametrize("threshold", [None, 0.5])
@pytest.mark.parametrize("proposal", [None, residual])
def test_evidence_is_unbiased_with_bad_first_stage_weights(first_stage, threshold, proposal):
    proposal = proposal and jaxpf.proposals.Linearised(proposal)
    assert scores(walk(first_stage=first_stage, ess_threshold=threshold, proposal=proposal)) < LIMIT


@jaxpf.pytree_dataclass
class Guided(Gaussian):
    """First-stage weights by the first object."""

    def log_first_stage(self, observation, substates):
        return norm.logpdf(observation[0, 0], substates[0, 0], 2.0)


def guided():
    its = problem((-1, -1), initial_scale=1.0)
    return its._replace(likelihood=Guided(its.likelihood.noise, its.likelihood.observation))


def test_parts_are_not_exchanged_where_first_stage_weights_made_weights_unequal():
    """Exchange needs equal weights, which only the first frame has here."""
    its = guided()
    tracker = its.tracker(jaxpf.ordering.sps((-1, -1)), keep_ancestors=True)
    first, *later = jaxpf.run(tracker, KEY, its.frames, lambda state, _: state.sources)[1]
    assert (first[0] != first[1]).any()
    for sources in later:
        np.testing.assert_array_equal(sources[0], sources[1])


@pytest.mark.slow
@pytest.mark.parametrize("order", ["ps", "sps"])
def test_first_stage_weights_of_several_objects_leave_the_evidence_unbiased(order):
    its = guided()
    ordering = jaxpf.ordering.ps([0, 1]) if order == "ps" else jaxpf.ordering.sps((-1, -1))
    keys = jax.random.split(KEY, 6000)
    runs = jaxpf.monte_carlo(its.tracker(ordering), keys, its.frames, batch_size=2000)
    ratio = np.exp(np.asarray(runs.log_evidence, float).sum(1) - its.log_evidence.sum())
    assert z_score(ratio, 1) < LIMIT
