"""The genealogy and Metropolis steps against Rauch-Tung-Striebel: unbiased at any number.

``Z^`` times a smoothed moment has the exact mean at any number of particles with multinomial
resampling, for the genealogy and for backward draws that start from the right law.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import COMPILER_OPTIONS, LIMIT, WRONG, problem, rauch_tung_striebel
from jax.scipy.stats import norm

import jaxpf
from jaxpf import ordering
from jaxpf.likelihoods import kalman
from jaxpf.smoothing import backward

pytestmark = pytest.mark.statistical

RUNS = 4000
SEEN = 1.5 * np.random.default_rng(0).normal(size=4)


def scores(tracker, frames, expected, **options):
    """z-scores of ``Z^ m / Z`` for moments ``m`` ``[K, ...]``, a row for each variant."""
    log_evidence, mean, variance = expected

    def one(key):
        found = jaxpf.smooth(tracker, key, frames, **options)
        moments = jnp.stack([found.estimate, found.estimate**2 + found.spread**2], -1)
        ratio = jnp.exp(jnp.sum(found.summaries.log_evidence) - log_evidence)
        return ratio * moments.reshape(-1, *mean.shape, 2)

    many = jax.jit(
        lambda keys: jax.lax.map(one, keys, batch_size=500), compiler_options=COMPILER_OPTIONS
    )
    found = np.asarray(many(jax.random.split(jax.random.key(5), RUNS)))
    off = found - np.stack([mean, variance + mean**2], -1)
    return np.abs(off.mean(0) / (off.std(0) / RUNS**0.5)).reshape(off.shape[1], -1).max(1)


def one_late(sources):
    return jnp.roll(sources, 1, axis=0)


@pytest.mark.slow
@pytest.mark.always
def test_the_genealogy_of_a_singular_motion_is_unbiased(monkeypatch):
    """Constant velocity with random acceleration; ancestors of the next frame are found out."""
    system, push = np.array([[1, 1], [0, 1.0]]), np.array([0.5, 1.0])
    answer = kalman(
        system, np.outer(push, push), np.eye(1, 2), np.eye(1), np.zeros(2), np.eye(2), SEEN[:, None]
    )
    smoothed = rauch_tung_striebel(system, np.outer(push, push), *answer[1:])
    expected = answer[0].sum(), smoothed[0], np.diagonal(smoothed[1], axis1=1, axis2=2)
    tracker = jaxpf.state_space(
        initial=lambda key, p: jax.random.normal(key, (2,)),
        transition=lambda key, x, p: system @ x + push * jax.random.normal(key),
        log_likelihood=lambda y, x, p: norm.logpdf(y, x[0]),
        num_particles=16,
        resampling="multinomial",
    )
    right = backward.trace_back

    def both(current, sources, log_weights):
        variants = jnp.stack([sources, one_late(sources)])
        return jax.vmap(right, in_axes=(None, 0, None))(current, variants, log_weights)

    monkeypatch.setattr(backward, "trace_back", both)
    as_it_is, late = scores(tracker, SEEN, expected, method="genealogy")
    assert as_it_is < LIMIT
    assert late > WRONG


@pytest.mark.slow
@pytest.mark.always
@pytest.mark.parametrize("is_late", [False, True])
def test_a_metropolis_step_keeps_the_law_of_an_ancestor(is_late, monkeypatch):
    """Second-order motion; one step does not repair a start from another frame's ancestor."""
    exact = problem((-1,), transition=1.4, lag=-0.8, initial_scale=1.0, num_frames=4)
    tracker = exact.tracker(ordering.sir(1), num_particles=16, resampling="multinomial")
    right = backward._backward_groups

    def late(tracker, keys, history, *rest):
        return right(tracker, keys, history._replace(sources=one_late(history.sources)), *rest)

    if is_late:
        monkeypatch.setattr(backward, "_backward_groups", late)
    of_state = exact.smoothed_mean[..., None], exact.smoothed_variance[..., None]
    expected = exact.log_evidence.sum(), *of_state
    (worst,) = scores(tracker, exact.frames, expected, method="metropolis", num_steps=1)
    assert worst > WRONG if is_late else worst < LIMIT


def test_metropolis_steps_lead_to_weight_times_density():
    """From one particle, over five: acceptance without or by the inverse ratio is found out."""
    weights, densities = np.array([0.4, 0.0, 0.3, 0.2, 0.1]), np.array([1.0, 2.0, 5.0, 0.0, 9.0])
    with np.errstate(divide="ignore"):
        log_weights, log_densities = np.log(weights), jnp.log(densities)
    index, broken = jax.jit(
        lambda key: backward._metropolis(
            key, log_weights, lambda i: log_densities[i], jnp.full(100_000, 3), 40
        )
    )(jax.random.key(0))
    expected = weights * densities / (weights @ densities)
    shares = np.bincount(index, minlength=5) / len(index)
    error = np.sqrt(expected * (1 - expected) / len(index))
    assert (np.abs(shares - expected) <= LIMIT * error).all()
    assert not broken.any()
