"""Gradients through resampling: forward pass, finiteness, the score of the motion, refusals.

Their expectation is checked in ``tests/statistical/test_unbiased_gradients.py``.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fenced_trackers import (
    FENCES,
    KEYS,
    METHODS,
    frames,
    tracker,
    value_and_gradient,
)
from proposed import Bad
from records import assert_equal
from refusals import message_of

import jaxpf
from jaxpf import gradients, ordering, pytree_dataclass, tuning
from jaxpf.dynamics import RandomWalk
from jaxpf.gradients import NoGradient, StopGradient, check_motion_gradient


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gradient", "methods"),
    [("stop_gradient", list(METHODS)), ("soft", ["dps", "literal"])],
)
def test_gradients_are_finite_whatever_becomes_impossible(gradient, methods):
    for name, fences in FENCES.items():
        for method in methods:
            made = tracker(METHODS[method], gradient=gradients.GRADIENTS[gradient])
            value, slope = value_and_gradient(made, KEYS, frames(fences))
            assert np.isfinite(slope).all(), name
            assert np.isneginf(value).all() == (name in ("all particles", "one partition")), name
            if name == "possible":
                assert (np.abs(slope) > 1e-3).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gradient", "num_particles"),
    [("none", 1), ("stop_gradient", 1), ("soft", 1), ("transport", 1), ("transport", 12)],
)
def test_gradients_are_finite_with_one_partition_and_few_particles(gradient, num_particles):
    if gradient == "transport":
        pytest.importorskip("ott", reason="needs jaxpf[transport]")
    for fences in FENCES.values():
        made = tracker(
            ordering.ps([0]), gradient=gradients.GRADIENTS[gradient], num_particles=num_particles
        )
        _, slope = value_and_gradient(made, KEYS[:2], frames(fences[:, :1], 1))
        assert np.isfinite(slope).all()


@pytest.mark.slow
def test_stop_gradient_leaves_the_forward_pass_as_it_is_bit_for_bit():
    seen = frames(FENCES["some particles"])
    for name in ("ps", "sps", "random"):  # of one shape: they share what is compiled
        for fenced in (seen, frames(FENCES["possible"])):
            kept = [
                jax.device_get(jaxpf.run(tracker(METHODS[name], gradient=mode()), KEYS[0], fenced))
                for mode in (NoGradient, StopGradient)
            ]
            (state, summaries), (other, others) = kept
            assert not np.any(other.path_scores)
            assert_equal((state, summaries), (dataclasses.replace(other, path_scores=None), others))


# The score of the motion.


@pytree_dataclass
class WholePixels:
    """Likelihood of the whole number next to the substate: what a box of pixels sees."""

    noise: jax.Array

    state_gradient = False

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * ((observation[0, 0] - jnp.round(substate[0])) / self.noise) ** 2


@jax.jit
def mean_evidence(made, scale, keys, seen):
    """Mean evidence over runs, and per run its gradient in the scale."""

    def log_evidence(scale, key):
        changed = dataclasses.replace(made, dynamics=RandomWalk(scale=scale))
        return tuning.log_evidence(changed, key[None], seen, checkpoint=False)[0]

    value, slope = jax.vmap(jax.value_and_grad(log_evidence), in_axes=(None, 0))(scale, keys)
    return jnp.exp(value), jnp.exp(value) * slope


@pytest.mark.slow
def test_score_of_the_motion_finds_the_slope_that_whole_pixels_hide():
    seen = np.float32([[[2.0]], [[3.0]], [[5.0]]])
    keys = jax.random.split(jax.random.key(1), 4000)
    made = tracker(
        ordering.ps([0]),
        likelihood=WholePixels(noise=np.float32(1.5)),
        gradient=StopGradient(),
        num_particles=50,
    )
    step = 0.1
    ends = [mean_evidence(made, 1.5 + sign * step, keys, seen)[0] for sign in (1, -1)]
    differences = np.asarray(ends[0] - ends[1]) / (2 * step)
    expected, its_error = differences.mean(), differences.std() / len(keys) ** 0.5
    assert expected > 20 * its_error
    _, pathwise = mean_evidence(made, 1.5, keys, seen)
    np.testing.assert_array_equal(pathwise, 0.0)  # silently wrong
    _, score = mean_evidence(dataclasses.replace(made, motion_gradient="score"), 1.5, keys, seen)
    score = np.asarray(score)
    error = np.hypot(its_error, score.std() / len(keys) ** 0.5)
    assert abs(score.mean() - expected) < 4.5 * error
    assert score.mean() > 10 * error  # the test could tell it from zero


def test_every_draw_counts_once_in_the_slope_of_the_evidence():
    """By Fisher's identity it is the weighted mean of the scores along the particles' pasts.

    The proposal's density does not depend on the scale, and the draws are stopped.
    """
    made = tracker(METHODS["ps"], proposal=Bad(), gradient=StopGradient(), motion_gradient="score")
    seen = jnp.asarray(frames(FENCES["possible"]))

    def two_frames(scale, threshold):
        changed = dataclasses.replace(
            made, dynamics=RandomWalk(scale=scale), ess_threshold=threshold
        )
        start = changed.init(KEYS[0])
        start = dataclasses.replace(start, sources=jnp.zeros(start.lineage.shape, jnp.int32))
        first, one = changed.step(KEYS[0], start, seen[0])
        second, two = changed.step(KEYS[1], first, seen[1])
        slopes = one.log_evidence + two.log_evidence, second.log_weights, second.path_scores
        return slopes, (first, second)

    @jax.jit
    def slopes_of(threshold):
        two = partial(two_frames, threshold=threshold)
        return jax.jvp(two, (1.0,), (1.0,), has_aux=True)[1:]

    for threshold in (1.0, 0.01):  # selects always, or never
        (slope, of_weights, of_parts), (first, second) = slopes_of(threshold)
        scores = [np.square(state.lagged[0] - state.lagged[1])[0] - 1 for state in (first, second)]
        along = np.take_along_axis(scores[0], np.asarray(second.sources), axis=1) + scores[1]
        expected = np.sum(along.sum(axis=0) * np.exp(second.log_weights))
        assert abs(expected) > 0.1
        np.testing.assert_allclose(slope, expected, rtol=1e-3)
        # Each particle's derivative is divided among its parts.
        np.testing.assert_allclose(np.sum(of_parts, axis=0), of_weights, atol=1e-4)


def test_a_motion_gradient_that_would_be_zero_is_refused():
    made = tracker(ordering.ps([0]), likelihood=WholePixels(noise=np.float32(1.0)))
    assert "motion_gradient='score'" in message_of(check_motion_gradient, made)
    check_motion_gradient(dataclasses.replace(made, motion_gradient="score"))
    check_motion_gradient(tracker(ordering.ps([0])))
