"""Learned dynamics: what made a track is found in it; gaps, pooling, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import every, message_of

import jaxpf
from jaxpf.dynamics import LinearGaussian, fit

FRAMES = 20_000


def simulate(dynamics, frames=FRAMES, seed=0):
    """``[T, P, D]`` in float64."""
    rng = np.random.default_rng(seed)
    transition, lag = np.asarray(dynamics.transition), np.asarray(dynamics.lag)
    offset, noise = np.asarray(dynamics.offset), np.asarray(dynamics.noise)
    track = np.zeros((frames, *offset.shape))
    normal = rng.normal(size=track.shape)
    for t in range(2, frames):
        past = np.einsum("pij,pj->pi", transition, track[t - 1])
        past += np.einsum("pij,pj->pi", lag, track[t - 2])
        track[t] = past + offset + np.einsum("pij,pj->pi", noise, normal[t])
    return track


TRUTH = LinearGaussian(
    transition=np.array([[[1.2, 0.1], [0.0, 0.9]], [[0.5, 0.0], [0.2, 1.1]]]),
    lag=np.array([[[-0.4, 0.0], [0.1, -0.3]], [[0.2, 0.0], [0.0, -0.4]]]),
    offset=np.array([[1.0, -2.0], [0.0, 3.0]]),
    noise=np.array([[[2.0, 0.0], [0.7, 1.0]], [[0.5, 0.0], [-0.2, 3.0]]]),
)


def test_all_coefficients_of_a_long_track_are_found():
    found = fit(simulate(TRUTH), 2, coefficients="all")
    for name in ("transition", "lag", "noise"):
        np.testing.assert_allclose(getattr(found, name), getattr(TRUTH, name), atol=0.1)
    np.testing.assert_allclose(found.offset, TRUTH.offset, atol=0.3)


def test_a_wandering_track_gives_the_momentum_of_its_steps():
    momentum, scale = 0.6, 3.0
    eye = np.eye(1)[None]
    walk = LinearGaussian(
        eye * (1 + momentum), eye * scale, -eye * momentum, None, np.zeros((1, 1))
    )
    found = fit(simulate(walk), 2)
    error = 4.5 / np.sqrt(FRAMES)
    assert float(-found.lag[0, 0, 0]) == pytest.approx(momentum, abs=error)
    assert float(found.noise[0, 0, 0]) == pytest.approx(scale, abs=scale * error)
    np.testing.assert_allclose(found.transition + found.lag, 1, atol=1e-6)


def test_gaps_are_left_out_and_targets_pooled():
    track = simulate(TRUTH)[:, :1]
    both = np.concatenate([track, track], axis=1)
    holed = both.copy()
    holed[50:60, 0] = np.nan
    holed[-40:, 1] = np.nan
    pooled = fit(holed, 1, coefficients="own", pooled=True)
    assert pooled.lag is None
    np.testing.assert_array_equal(pooled.transition[0], pooled.transition[1])
    np.testing.assert_allclose(
        pooled.transition, fit(both, 1, coefficients="own").transition, atol=0.01
    )


def test_what_is_learned_moves_particles():
    found = fit(simulate(TRUTH, 200), 2, coefficients="own")
    moved = found.propagate(jax.random.key(0), 1, jnp.ones(2), jnp.zeros(2), jnp.zeros(2))
    assert moved.shape == (2,)
    assert jaxpf.dynamics.fit is fit


@every([
    (lambda: fit(simulate(TRUTH, 5), 2, coefficients="all"), "3 steps of target 0"),
    (lambda: fit(simulate(TRUTH, 50), 3), "order = 3"),
    (lambda: fit(simulate(TRUTH, 50), coefficients="some"), "coefficients='some'"),
])  # fmt: skip
def test_what_cannot_be_fitted_is_refused(call, named):
    assert named in message_of(call)
