"""The labelled filter: one target is an ordinary filter, labels within are many of them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from models import start, step

import jaxpf
from jaxpf.contract import state as states
from jaxpf.dynamics import AR2, FirstOrder, IndependentGaussian
from jaxpf.likelihoods import Gaussian

FRAMES = np.random.default_rng(0).normal(size=(6, 3, 2)).astype(np.float32).cumsum(axis=0)


def tracker(num_targets=3, num_particles=60, **settings):
    eye = np.tile(np.eye(2, dtype=np.float32), (num_targets or 3, 1, 1))
    defaults = {
        "dynamics": AR2(scale=(1.0, 1.0)),
        "likelihood": Gaussian(noise=0.5 * eye),
        "initial": np.zeros((num_targets or 3, 2), np.float32),
    }
    return jaxpf.Labelled(**(defaults | {"num_particles": num_particles} | settings))


_run = jax.jit(jaxpf.run, static_argnames="record")
monte_carlo = jax.jit(jaxpf.monte_carlo)


def run(*arguments):
    return jax.device_get(_run(*arguments))


@pytest.mark.parametrize(
    ("weights", "scheme"),
    [
        ("equal_share", "systematic"),
        pytest.param("plain", "multinomial", marks=pytest.mark.slow),
        pytest.param("corrected", "residual", marks=pytest.mark.slow),
    ],
)
def test_one_target_gives_the_particles_of_partitioned_key_for_key(weights, scheme):
    one = tracker(1, initial=IndependentGaussian(np.zeros((1, 2)), 1.0))
    one = dataclasses.replace(one, weights=weights, resampling=scheme)
    same = jaxpf.Partitioned(
        dynamics=one.dynamics,
        likelihood=one.likelihood,
        ordering=jaxpf.ordering.sir(1),
        initial=one.initial,
        num_particles=60,
        resampling=scheme,
    )
    key, frames = jax.random.key(3), FRAMES[:, :1]
    state, found = run(one, key, frames)
    expected_state, expected = run(same, key, frames)
    np.testing.assert_array_equal(state.substates, expected_state.substates)
    for name in ("estimate", "log_evidence", "ess", "distinct_share", "spread"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=2e-4, atol=1e-5, err_msg=name
        )
    np.testing.assert_allclose(found.label_log_evidence[:, 0], expected.log_evidence, rtol=1e-4)


@pytest.mark.slow
def test_shares_are_fair_under_equal_share_and_drift_without():
    keys = jax.random.split(jax.random.key(0), 20)
    frames = FRAMES.copy()
    frames[:, 2] += 2.5  # less likely than the others
    share = {
        weights: np.asarray(monte_carlo(tracker(weights=weights), keys, frames).distinct_share)
        for weights in ("equal_share", "plain")
    }
    assert np.all(np.abs(share["equal_share"] - 1 / 3) <= 1.01 / 60)
    assert share["plain"][:, -1, 2].mean() < 0.05


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_a_label_s_evidence_is_that_of_its_carried_mass(weights):
    """By hand: without noise all particles of a target are one, and drawn shares vary alone.

    A label's evidence is its new mass over that of the frame before.
    """
    noise, frames = np.array([1.0, 1.3, 2.0]), 0.3 * FRAMES[:4]
    chosen = tracker(
        dynamics=AR2(scale=0.0), likelihood=Gaussian(noise=noise[:, None, None] * np.eye(2)),
        weights=weights,
    )  # fmt: skip
    _, summary = run(chosen, jax.random.key(0), frames)
    likelihood = scipy.stats.norm.pdf(frames, scale=noise[:, None]).prod(axis=-1)
    expected, mass = [], np.full(3, 1 / 3)
    for share, seen in zip(np.asarray(summary.distinct_share), likelihood, strict=True):
        entering = share if weights == "plain" else 3 * share * mass
        expected.append(np.log(entering * seen / mass))
        mass = entering * seen / np.sum(entering * seen)
    assert mass.min() > 0
    assert np.ptp(mass) > 0.3
    np.testing.assert_allclose(summary.label_log_evidence, expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("weights", ["equal_share", "plain"])
def test_a_target_without_likelihood_is_reported_and_nothing_becomes_nan(weights):
    frames = FRAMES.copy()
    frames[2, 1] = 1e20  # no particle of target 1 has any likelihood
    state, summary = run(tracker(weights=weights), jax.random.key(0), frames)
    lost = np.asarray(summary.without_likelihood)
    assert lost[2].tolist() == [False, True, False]
    assert np.asarray(summary.status)[2] & states.STATUS_WITHOUT_LIKELIHOOD
    assert np.all(np.isfinite(summary.estimate))
    assert np.all(np.isfinite(summary.spread))
    assert not np.any(np.isnan(summary.label_log_evidence))
    assert np.all(np.isfinite(summary.log_evidence))
    np.testing.assert_array_equal(np.asarray(summary.ess_parts) == 0, lost)
    # With equal shares its particles go on; else its weight is rightly zero.
    assert lost[3:, 1].all() == (weights != "equal_share")
    assert not lost[:, [0, 2]].any()
    assert not np.any(np.isnan(state.log_weights))
    assert np.isneginf(np.sum(summary.label_log_evidence, axis=0)[1])


def without_target_1(**settings):
    """A tracker and a state in which target 1 has no particles left."""
    chosen = tracker(**settings)
    state = start(chosen)
    state, _ = step(chosen, jax.random.key(1), state, FRAMES[0])
    labels = np.where(np.asarray(state.labels) == 1, 0, state.labels)
    return chosen, dataclasses.replace(state, labels=labels, lost=np.array([False, True, False]))


def test_a_target_without_particles_is_reported_and_holds_its_estimate():
    chosen, state = without_target_1()
    after, summary = step(chosen, jax.random.key(2), state, FRAMES[1])
    assert summary.without_likelihood.tolist() == [False, True, False]
    assert summary.distinct_share[1] == 0
    assert summary.ess_parts[1] == 0
    assert summary.ess == 0
    np.testing.assert_array_equal(summary.estimate[1], state.estimate[:, 1])
    assert np.isfinite(summary.log_evidence)
    assert not np.any(np.isnan(after.log_weights))
    # The others share what there is: no particle has weight without a label that has.
    np.testing.assert_allclose(np.exp(after.log_weights).sum(), 1, rtol=1e-5)


def test_speed_is_fed_back_as_equations_5_and_6_say():
    """One frame by hand; without noise all particles of a target are one."""
    first = np.array([[0.0, 0, 3, 1], [5, 5, -1, 2]], np.float32)
    rates = (0.6, 0.3)
    eye = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    chosen = jaxpf.Labelled(
        dynamics=FirstOrder(scale=0.0),
        likelihood=Gaussian(noise=eye),
        initial=first,
        num_particles=8,
        feedback="estimate",
        regularise=rates,
        speed=(2, 3),
    )
    state = start(chosen)
    # Particles that are off by a pixel, and whose speeds are nonsense.
    lagged = np.array(state.lagged)
    lagged[0, :2] += 1.0
    lagged[0, 2:] = -7.0
    state, summary = step(
        chosen,
        jax.random.key(1),
        dataclasses.replace(state, lagged=lagged),
        np.zeros((2, 4), np.float32),
    )
    moved = first[:, :2] + 1.0 - 7.0
    position = 0.4 * (first[:, :2] + first[:, 2:]) + 0.6 * moved
    speed = 0.7 * first[:, 2:] + 0.3 * (position - first[:, :2])
    np.testing.assert_allclose(summary.estimate, np.hstack([position, speed]), rtol=1e-5)
    # The particles' next speed is the estimate of the frame before, not their own.
    np.testing.assert_allclose(state.lagged[0, 2:, 0], first[0, 2:], rtol=1e-5)
    np.testing.assert_allclose(state.lagged[0, :2, 0], moved[0], rtol=1e-5)


def test_speed_is_fed_back_to_a_second_order_motion_as_its_last_displacement():
    chosen = tracker(feedback="estimate", dynamics=AR2(scale=0.0, momentum=1.0))
    state = start(chosen)
    velocity = np.float32([[1.0, 2, 3], [4, 5, 6]])
    state = dataclasses.replace(state, velocity=velocity)
    after, _ = step(chosen, jax.random.key(1), state, FRAMES[0])
    np.testing.assert_allclose(after.lagged[0], velocity[:, np.asarray(after.labels)], rtol=1e-6)


def test_without_options_the_estimate_is_the_weighted_mean():
    state, summary = run(tracker(), jax.random.key(0), FRAMES)
    weights = np.exp(np.asarray(state.log_weights))[:, None, None]
    values = np.asarray(state.substates)
    holds = np.isfinite(values)
    mean = np.nansum(weights * values, axis=0) / np.sum(weights * holds, axis=0)
    np.testing.assert_allclose(summary.estimate[-1], mean, rtol=1e-4, atol=1e-5)
    assert summary.ess[-1] == np.min(summary.ess_parts[-1])


def test_many_targets_are_weighed_as_few_are(monkeypatch):
    from jaxpf.filters.labelled import by_label

    rng = np.random.default_rng(1)
    labels, values = rng.integers(0, 5, 200).astype(np.int32), rng.normal(size=(3, 200))
    values[0, labels == 4] = -np.inf

    def weighed():
        return (
            by_label.counts(labels, 6),
            by_label.sums(jnp.asarray(values[1:]), jnp.asarray(labels), 6),
            by_label.log_sums(jnp.asarray(values[0]), jnp.asarray(labels), 6),
        )

    expected = jax.jit(lambda: weighed())()
    monkeypatch.setattr(by_label, "FEW", 1)
    found = jax.jit(lambda: weighed())()
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-5)
    assert np.isneginf(np.asarray(found[2])[4:]).all()
