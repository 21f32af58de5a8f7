"""Factored filters: what they refuse, what they survive, and how partitions help one another."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf.dynamics import RandomWalk

run, monte_carlo = jax.jit(jaxpf.run), jax.jit(jaxpf.monte_carlo)

START = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0]])


@jaxpf.pytree_dataclass
class Seen:
    """Points seen with noise; where the frame holds NaN, nothing tells places apart."""

    scale: float = 1.0
    when_hidden: float = 0.0

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        place = observation[partition]
        hidden = jnp.isnan(place[0])
        apart = jnp.where(hidden, 0.0, place - substate) / self.scale
        return jnp.where(hidden, self.when_hidden, -0.5 * apart @ apart)


def trackers(likelihood=None, scale=2.0, **settings):
    """One of each; used with 12 frames of three points, so that tests share compiled kernels."""
    likelihood = Seen() if likelihood is None else likelihood
    walk = RandomWalk(scale)
    return {
        "auxiliary": jaxpf.PFFL(walk, likelihood, START, **settings),
        "literal": jaxpf.PFFL(walk, likelihood, START, form="literal", **settings),
        "eskil": jaxpf.Eskil(walk, likelihood, START, **settings),
        "proper": jaxpf.Eskil(
            walk, likelihood, START, drift="ridge", proper=True, shape="none", **settings
        ),
    }


def moving(num_frames=12, step=2.0):
    """All three points go to the right together."""
    return START + step * np.arange(1, num_frames + 1)[:, None, None] * np.array([1.0, 0.0])


@pytest.mark.parametrize(
    "name",
    [
        "eskil",
        "proper",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("auxiliary", "literal")),
    ],
)
def test_points_that_are_seen_are_followed(name):
    frames = moving()
    tracker = trackers()[name]
    state, summary = run(tracker, jax.random.key(0), frames)
    assert np.abs(summary.estimate - frames).max() < 3.0
    assert summary.ess_parts.shape == (12, 3)
    np.testing.assert_allclose(summary.ess, np.min(summary.ess_parts, axis=1))
    assert state.substates.shape == (tracker.num_particles * tracker.upsampling, 3, 2)
    np.testing.assert_allclose(np.exp(state.log_weights).sum(axis=1), 1, rtol=1e-5)
    assert np.isnan(summary.log_evidence).all() == (name == "eskil")


@jaxpf.pytree_dataclass
class Failing:
    """A user's dynamics, for one particle, that now and then divide by zero."""

    def propagate(self, key, partition, current, previous, parent):
        moved = current + 2.0 * jax.random.normal(key, current.shape)
        return jnp.where(jax.random.uniform(key) < 0.2, jnp.nan, moved)


@pytest.mark.parametrize("shape", ["relative", pytest.param("none", marks=pytest.mark.slow)])
def test_a_particle_that_is_nowhere_harms_nobody(shape):
    tracker = jaxpf.Eskil(Failing(), Seen(), START, num_particles=40, shape=shape)
    _, summary = run(tracker, jax.random.key(0), moving())
    assert (np.asarray(summary.num_invalid) > 0).all()
    assert np.abs(summary.estimate - moving()).max() < 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "least", "most"),
    [
        ({"drift": "clip"}, 0, 10),
        ({"drift": "ridge"}, 0, 10),
        ({"drift": "none"}, 18, 30),
        ({"drift": "none", "shape": "relative", "shape_scale": 0.02}, 0, 6),
    ],
)
def test_drift_and_shape_carry_a_hidden_point_along(options, least, most):
    """The third, hidden for the last 10 frames; left behind, it would be 20 pixels away."""
    frames = moving(20)
    frames[10:, 2] = np.nan
    settings = {"num_particles": 60, "shape": "none"} | options
    tracker = jaxpf.Eskil(RandomWalk(1.0), Seen(), START, **settings)
    summary = monte_carlo(tracker, jax.random.split(jax.random.key(2), 20), frames)
    error = np.asarray(summary.estimate)[:, -1, 2] - moving(20)[-1, 2]
    assert least < np.mean(np.linalg.norm(error, axis=-1)) < most


@pytest.mark.parametrize("name", ["auxiliary", "literal", "eskil", "proper"])
@pytest.mark.parametrize("nothing", [-np.inf, np.nan, 0.0])
def test_nothing_is_lost_when_all_points_are_hidden(name, nothing):
    frames = np.full((12, 3, 2), np.nan)
    frames[..., 1] = 0.0  # a frame of nothing but NaN would be a missing one
    tracker = trackers(Seen(when_hidden=nothing))[name]
    state, summary = run(tracker, jax.random.key(0), frames)
    assert np.isfinite(summary.estimate).all()
    assert np.isfinite(summary.spread).all()
    np.testing.assert_allclose(np.exp(state.log_weights).sum(axis=1), 1, rtol=1e-5)
    assert np.all(np.asarray(summary.without_likelihood) == (nothing != 0))
    assert np.all((np.asarray(summary.ess_parts) == 0) == (nothing != 0))
    assert np.all(np.asarray(summary.num_invalid) > 0) == np.isnan(nothing)
    if name != "eskil":
        assert np.all(np.isneginf(summary.log_evidence)) == (nothing != 0)


@pytest.mark.slow
def test_one_point_with_one_particle_stays_finite_and_so_do_gradients():
    def total(tracker, frames):
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames)
        return jnp.sum(summary.estimate)

    shown, hidden = moving(4), np.full((4, 3, 2), np.nan)
    alone = {"num_particles": 1, "upsampling": 1, "drift": "none", "shape": "none"}
    cases = [
        (jaxpf.PFFL(RandomWalk(1.0), Seen(), START[:1], num_particles=1), shown[:, :1]),
        (jaxpf.Eskil(RandomWalk(1.0), Seen(), START[:1], **alone), shown[:, :1]),
        (jaxpf.Eskil(RandomWalk(1.0), Seen(), START), hidden),
        (jaxpf.Eskil(RandomWalk(1.0), Seen(when_hidden=-np.inf), START), hidden),
        (jaxpf.Eskil(RandomWalk(1.0), Seen(), START), shown),
    ]
    differentiated = jax.jit(jax.value_and_grad(total))
    for tracker, frames in cases:
        value, gradient = differentiated(tracker, frames)
        assert np.isfinite(value)
        for leaf in jax.tree.leaves((gradient.dynamics, gradient.initial)):
            assert np.isfinite(leaf).all()


@pytest.mark.parametrize("name", ["eskil", "proper"])
def test_points_that_do_not_move_have_no_correlation_to_divide_by(name):
    """sigma_i = 0 (eq. 8): the others then count alike."""
    frames = np.broadcast_to(START, (12, 3, 2)).copy()
    tracker = trackers(scale=1e-30)[name]  # a drift needs some noise
    if name == "eskil":
        tracker = jaxpf.Eskil(RandomWalk(0.0), Seen(), START)
    _, summary = run(tracker, jax.random.key(0), frames)
    np.testing.assert_allclose(summary.estimate, frames, atol=1e-3)
