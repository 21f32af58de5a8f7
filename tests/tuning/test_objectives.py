"""Objectives: the log evidence and supervised losses, differentiable in the tracker."""

import re
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import message_of

import jaxpf
from jaxpf import measures, ordering, pytree_dataclass, tuning
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian
from jaxpf.measures import crps
from jaxpf.shapes import boxes_from_substates

T, R = 7, 4
KEYS = jax.random.split(jax.random.key(0), R)
FRAMES = np.random.default_rng(0).normal([20, 30, 1], 1, (T, 1, 3)).astype(np.float32)


def tracker(**settings):
    defaults = {
        "dynamics": RandomWalk(scale=np.float32([2.0, 2.0, 0.1])),
        "likelihood": Gaussian(noise=np.eye(3, dtype=np.float32)[None]),
        "ordering": ordering.ps([0]),
        "initial": np.float32([[20.0, 30.0, 1.0]]),
        "num_particles": 20,
    }
    return jaxpf.Partitioned(**(defaults | settings))


many = jax.jit(jaxpf.monte_carlo)


@pytest.fixture(scope="module")
def summaries():
    return jax.device_get(many(tracker(), KEYS, FRAMES))


TRUTH = np.full((T, 1, 2), np.nan, np.float32)
TRUTH[2], TRUTH[5] = [21.0, 29.0], [18.0, 33.0]
SIZES = np.float32([[12.0, 9.0]])
BOXES = np.full((T, 1, 4), np.nan, np.float32)
BOXES[1], BOXES[4] = [15, 24, 12, 10], [90, 90, 5, 5]


@pytree_dataclass
class Never:
    """A likelihood by which nothing is possible."""

    noise: jax.Array

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return jnp.where(substate[0] < jnp.inf, -jnp.inf, self.noise)


@partial(jax.jit, static_argnames=("objective", "checkpoint"))
def with_gradient(objective, made, *labels, checkpoint=False):
    """An objective's values, and the gradient of their mean in the motion's scale."""

    def mean(made):
        values = objective(made, KEYS, FRAMES, *labels, checkpoint=checkpoint)
        return jnp.mean(values), values

    (_, values), gradient = jax.value_and_grad(mean, has_aux=True, allow_int=True)(made)
    return values, gradient.dynamics.scale


@pytest.mark.slow
@pytest.mark.always
def test_log_evidence_is_that_of_the_runs(summaries):
    found, slope = with_gradient(tuning.log_evidence, tracker())
    np.testing.assert_allclose(found, summaries.log_evidence.sum(1), rtol=1e-5)
    assert np.abs(slope).min() > 1e-3


@pytest.mark.parametrize("checkpoint", [True, pytest.param(3, marks=pytest.mark.slow)])
def test_checkpoints_change_neither_value_nor_gradient(checkpoint):
    """Of a walk, of which one program holds both."""

    @jax.jit
    def both(scale):
        made = jaxpf.state_space(
            initial=0.0,
            transition=lambda key, x, p: x + p * jax.random.normal(key),
            log_likelihood=lambda y, x, p: -0.5 * (y - x) ** 2,
            parameters=scale,
            num_particles=10,
        )

        def mean(scale, way):
            its = tuning.replace(made, {"parameters": scale})
            return jnp.mean(tuning.log_evidence(its, KEYS, FRAMES[:, 0, 2], checkpoint=way))

        return [jax.value_and_grad(mean)(scale, way) for way in (False, checkpoint)]

    (value, slope), (same, other) = both(jnp.float32(0.5))
    np.testing.assert_allclose(same, value, rtol=1e-5)
    assert np.abs(slope) > 1e-3
    np.testing.assert_allclose(other, slope, rtol=1e-3)


def test_an_evidence_of_zero_has_a_finite_gradient():
    never = tracker(likelihood=Never(noise=np.float32(1.0)))
    values, slope = with_gradient(tuning.log_evidence, never)
    assert np.isneginf(values).all()
    assert np.isfinite(slope).all()


def test_losses_are_those_of_the_measures(summaries):
    """Of labelled frames alone; a normal as wide as the particles has their CRPS."""
    losses = tuning.position_error, tuning.crps_loss, tuning.iou_loss
    labels = (TRUTH,), (TRUTH,), (BOXES, SIZES)

    @jax.jit
    def of_runs(made):
        return [
            loss(made, KEYS, FRAMES, *given, checkpoint=False)
            for loss, given in zip(losses, labels, strict=True)
        ]

    offset = np.asarray(summaries.estimate)[:, [2, 5], 0, :2] - TRUTH[[2, 5], 0]
    spread = np.asarray(summaries.spread)[:, [2, 5], 0, :2]
    boxes = boxes_from_substates(summaries.estimate[:, [1, 4]], SIZES)
    assert (measures.iou(boxes, BOXES[[1, 4]])[:, 1] == 0).all()
    expected = [
        np.linalg.norm(offset, axis=-1).mean(1),
        crps(offset, spread).mean((1, 2)),
        (1 - measures.iou(boxes, BOXES[[1, 4]])).mean((1, 2)),
    ]
    np.testing.assert_allclose(of_runs(tracker()), expected, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loss", "labels"),
    [
        (tuning.position_error, (TRUTH,)),
        (tuning.crps_loss, (TRUTH,)),
        (tuning.iou_loss, (BOXES, SIZES)),
    ],
)
def test_losses_have_gradients_whatever_is_not_labelled(loss, labels):
    _, slope = with_gradient(loss, tracker(), *labels)
    assert np.isfinite(slope).all()
    assert np.abs(slope[:2]).max() > 0


@pytest.mark.slow
def test_an_estimate_without_a_spread_has_a_finite_gradient():
    """Position error, here of an exact estimate, and CRPS, which is the distance."""
    still = tracker(dynamics=RandomWalk(scale=np.zeros(3, np.float32)), num_particles=1)
    exact = np.broadcast_to(np.float32([20, 30]), (T, 1, 2))

    def both(made, keys, frames, exact, truth, checkpoint):
        error = tuning.position_error(made, keys, frames, exact, checkpoint=checkpoint)
        return jnp.stack(
            [error, tuning.crps_loss(made, keys, frames, truth, checkpoint=checkpoint)]
        )

    (error, crps_), slope = with_gradient(both, still, exact, TRUTH)
    np.testing.assert_array_equal(error, 0.0)
    np.testing.assert_allclose(crps_, np.nanmean(np.abs(TRUTH - [20.0, 30.0])), rtol=1e-6)
    assert np.isfinite(slope).all()


def test_crps_asks_for_an_honest_spread():
    """Of a filter that is as sure as the frames allow, one too sure, and one too unsure."""
    rng = np.random.default_rng(3)
    truth = np.float32(np.cumsum(rng.normal(0, 2, (60, 1, 3)), axis=0))
    frames = truth + np.float32(rng.normal(0, 1, truth.shape))

    @jax.jit
    def score(noise):
        likelihood = Gaussian(noise=noise * np.eye(3, dtype=np.float32)[None])
        walk = RandomWalk(scale=np.full(3, 2.0, np.float32))
        made = tracker(likelihood=likelihood, dynamics=walk, initial=truth[0], num_particles=1000)
        return tuning.crps_loss(made, KEYS, frames, truth[..., :2], checkpoint=False)

    honest, sure, unsure = (np.asarray(score(np.float32(x))) for x in (1.0, 0.1, 10.0))
    for other in (sure, unsure):
        # Runs share the truth, of which one is enough: they differ by chance alone.
        assert (other - honest).mean() > 5 * (other - honest).std(ddof=1) / np.sqrt(R)


PAIRS = np.zeros((T, 1, 2))


@pytest.mark.parametrize(
    ("call", "arguments", "what"),
    [
        (tuning.log_evidence, (KEYS, FRAMES[:0]), "frame"),
        (partial(tuning.log_evidence, checkpoint=0), (KEYS, FRAMES), "checkpoint"),
        (tuning.outline_loss, (KEYS, FRAMES, PAIRS, len), r"\[7, 1, V, >= 2\]"),
        (tuning.iou_loss, (KEYS, FRAMES, PAIRS, [[1, 1]]), r"\[7, 1, >= 4\]"),
        (tuning.position_error, (KEYS, FRAMES, np.zeros((T, 2, 2))), "truth"),
        (tuning.position_error, (KEYS, FRAMES, PAIRS + np.nan), "truth"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, arguments, what):
    assert re.search(what, message_of(call, tracker(), *arguments))


def test_a_missing_frame_changes_no_evidence():
    frames = np.where(np.arange(T)[:, None, None] == 1, np.nan, FRAMES).astype(np.float32)
    expected = many(tracker(), KEYS, frames).log_evidence
    found = jax.jit(tuning.log_evidence)(tracker(), KEYS, frames)
    assert (expected[:, 1] == 0).all()
    np.testing.assert_allclose(found, expected.sum(1), rtol=1e-5)
