"""Points by a network's features: scores against a plain computation, and following."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from histograms import texture

import jaxpf
import jaxpf.points
from jaxpf.likelihoods import pretrained_points
from jaxpf.likelihoods.pretrained.points import PretrainedPoints

HEIGHT, WIDTH = 90, 130  # filled up to 96 x 160
FRAME, OTHER = texture(0, HEIGHT, WIDTH, 1), texture(3, HEIGHT, WIDTH, 1)
POINTS = np.array([[61.3, 40.2], [100.0, 70.5], [3.0, 88.0]])

_OBSERVE = jax.jit(PretrainedPoints.observe)
_LOG_PROBS = jax.jit(PretrainedPoints.log_prob_all)
_LOG_ODDS = jax.jit(PretrainedPoints.log_odds_all)


def blocks(picture, side):
    """The pixels of each block as its features."""
    height, width, _ = picture.shape
    split = picture.reshape(height // side, side, width // side, side, 3)
    return split.swapaxes(1, 2).reshape(height // side, width // side, -1)


def two_maps(picture):
    return blocks(picture, 4), blocks(picture, 8)


def interpolated(values, x, y):
    """Values [h, w, ...] at a place in blocks, linearly between their centres."""
    rows, columns = values.shape[:2]
    x, y = np.clip(x - 0.5, 0, columns - 1), np.clip(y - 0.5, 0, rows - 1)
    left, top = min(int(x), columns - 2), min(int(y), rows - 2)
    a, b = x - left, y - top
    above = (1 - a) * values[top, left] + a * values[top, left + 1]
    below = (1 - a) * values[top + 1, left] + a * values[top + 1, left + 1]
    return (1 - b) * above + b * below


@pytest.fixture(scope="module")
def learned():
    return pretrained_points(FRAME, POINTS, network=two_maps, sharpness=7.0, slip=3.0)


def test_the_score_is_the_mean_cosine_of_standardised_maps():
    """With one map; two are compared by their sum below."""
    one = pretrained_points(FRAME, POINTS, network=partial(blocks, side=4), sharpness=7.0)

    def maps(frame):
        filled = np.pad(frame, ((0, 6), (0, 30), (0, 0)), mode="edge").astype(np.float64) / 255
        return np.asarray(blocks(filled, 4))

    start, now = maps(FRAME), maps(OTHER)
    middle, spread = start.mean((0, 1)), start.std((0, 1)) + 1e-3
    start, now = (start - middle) / spread, (now - middle) / spread
    now /= np.linalg.norm(now, axis=-1, keepdims=True)
    places = np.array([[50.0, 30.0], [129.9, 0.1], [77.7, 89.9]])
    seen = _OBSERVE(one, OTHER)
    found = _LOG_PROBS(one, seen, jnp.arange(3), jnp.asarray(places.T, jnp.float32))
    for point, place, value in zip(POINTS, places, found, strict=True):
        reference = interpolated(start, *point / 4)
        cosines = now @ reference / np.linalg.norm(reference)
        assert value == pytest.approx(7 * interpolated(cosines, *place / 4), abs=1e-4)


def test_maps_of_two_strides_count_the_same(learned):
    seen = _OBSERVE(learned, OTHER)
    alone = [
        _OBSERVE(pretrained_points(FRAME, POINTS, network=partial(blocks, side=side)), OTHER)
        for side in (4, 8)
    ]
    larger = jax.image.resize(alone[1], alone[0].shape, "linear")
    np.testing.assert_allclose(seen, (alone[0] + larger) / 2, atol=1e-5)


def test_places_outside_the_frame_and_no_numbers(learned):
    seen = _OBSERVE(learned, FRAME)
    places = np.array([[np.nan, 3.0], [1e30, -1e30], [-0.1, 40.0], [40.0, 90.0]], np.float32)
    found = _LOG_PROBS(learned, seen, jnp.zeros(4, int), places.T)
    np.testing.assert_array_equal(found, [np.nan, 0, 0, 0])
    odds = _LOG_ODDS(learned, seen, jnp.zeros(4, int), places.T)
    np.testing.assert_array_equal(np.isnan(odds), [True, False, False, False])


def test_the_derivative_in_the_place_is_that_of_the_interpolation(learned):
    seen = _OBSERVE(learned, OTHER)

    @jax.jit
    def log_prob(place):
        return learned.log_prob_all(seen, jnp.zeros(1, int), place[:, None])[0]

    place, step = jnp.array([50.3, 31.1]), 0.25  # within one block, where it is bilinear
    slope = jax.grad(log_prob)(place)
    for axis in range(2):
        moved = step * jnp.eye(2)[axis]
        difference = (log_prob(place + moved) - log_prob(place - moved)) / (2 * step)
        assert slope[axis] == pytest.approx(float(difference), rel=1e-3)


@pytest.mark.slow
def test_a_large_frame_is_shrunk_and_places_stay():
    small = texture(4, 96, 640)
    large = small.repeat(2, axis=0).repeat(2, axis=1)  # 1280 pixels wide
    points = np.array([[320.0, 50.0], [600.0, 20.0]])
    of_small = pretrained_points(small, points, network=two_maps)
    of_large = pretrained_points(large, 2 * points, network=two_maps)
    places = np.array([[300.0, 44.0], [633.0, 95.0]], np.float32)
    found = [
        _LOG_PROBS(of, _OBSERVE(of, frame), jnp.arange(2), factor * places.T)
        for of, frame, factor in ((of_small, small, 1), (of_large, large, 2))
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-4, atol=1e-4)


def test_points_are_followed_and_a_hidden_one_is_told():
    picture, patch = texture(5, HEIGHT, WIDTH, 1), texture(6, 40, 40, 1)
    frames, step = np.repeat(picture[None], 13, axis=0), 4  # as the blocks
    for time, frame in enumerate(frames):
        left = 20 + step * time
        frame[20:60, left : left + 40] = patch
        if time > 6:
            frame[40:60, left : left + 40] = 0  # the second point's half
    points = np.array([[40.0, 30.0], [40.0, 52.0]])
    network = partial(blocks, side=4)
    likelihood = pretrained_points(frames[0], points, network=network, slip=2.0)
    tracker = jaxpf.points.tracker(frames[0], points, likelihood=likelihood, num_particles=300)
    _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
    truth = points + np.array([step, 0]) * np.arange(1, 13)[:, None, None]
    apart = np.linalg.norm(jaxpf.points.to_points(tracker, summary.estimate) - truth, axis=-1)
    assert np.max(apart[:6]) < 4
    assert np.max(apart[:, 0]) < 4
    assert np.min(summary.confidence[:6]) > 0.5
    assert np.min(summary.confidence[:, 0]) > 0.5
    assert summary.confidence[-1, 1] < 0.5
    np.testing.assert_array_equal(likelihood.model_error, (2, 2, 0))


def test_the_tracker_takes_the_weights_of_the_package():
    tracker = jaxpf.points.tracker(FRAME, POINTS, sharpness=30.0)  # implies the appearance
    assert isinstance(tracker.likelihood, PretrainedPoints)
    assert tracker.likelihood.sharpness == 30
    assert [each.shape for each in tracker.likelihood.references] == [(3, 40), (3, 112)]
