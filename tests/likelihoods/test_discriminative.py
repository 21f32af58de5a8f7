"""Learned appearance: features, ridge regression, scores, gradients and refusals."""

import dataclasses

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from histograms import float_bins, texture

import jaxpf
from jaxpf.likelihoods import discriminative
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood
from jaxpf.likelihoods.discriminative.training import (
    BACKGROUNDS,
    before_background,
    ridge,
    training_boxes,
)

HEIGHT, WIDTH = 70, 91  # odd, so that the shrunk frame is filled up
#: One object that is shrunk by 2, and one that is not.
BOXES = np.array([[20.0, 12.0, 44.0, 40.0], [60.0, 40.0, 14.0, 22.0]])
_OBSERVE = jax.jit(DiscriminativeLikelihood.observe)
_LOG_PROBS = jax.jit(DiscriminativeLikelihood.log_prob_all)
_LOG_ODDS = jax.jit(DiscriminativeLikelihood.log_odds_all)
_SCORES = jax.jit(lambda *args: DiscriminativeLikelihood.scores_all(*args)[0])
#: Places of a grid of shifts; fewer are filled up to as many, so that tests share a program.
_NUM_PLACES = 625


def scores(likelihood, seen, number, substates):
    more = _NUM_PLACES - substates.shape[1]
    number = np.pad(np.broadcast_to(number, substates.shape[1]), (0, more), mode="edge")
    filled = np.pad(substates.astype(np.float32), ((0, 0), (0, more)), mode="edge")
    return np.asarray(_SCORES(likelihood, seen, number, filled))[: substates.shape[1]]


def blocks(seed, height=HEIGHT, width=WIDTH):
    """Texture that is still there when the frame is shrunk."""
    return texture(seed, height, width, 5)


FRAME = blocks(0)


@pytest.fixture(scope="module")
def learned():
    return discriminative(FRAME, BOXES)


def substates_of(boxes):
    """[3, N] of boxes of the first or the second object's shape."""
    boxes = np.asarray(boxes, float)
    number = np.isclose(boxes[:, 2] / boxes[:, 3], BOXES[1, 2] / BOXES[1, 3]).astype(int)
    scale = boxes[:, 2] / BOXES[number, 2]
    centre = boxes[:, :2] + boxes[:, 2:] / 2
    return number, np.column_stack([centre, scale]).T.astype(np.float32)


def test_a_box_reaches_the_border_where_it_is_cut_by_it(learned):
    """The second object's box, 14 x 22 pixels: inside, at each side, and twice as large."""
    u = np.array([7.5, 7.0, 84.0, 45.0, 45.0, 15.0, 14.0])
    v = np.array([11.5, 30.0, 30.0, 11.0, 59.5, 30.0, 30.0])
    scale = np.array([1.0, 1, 1, 1, 1, 2, 2])
    found = learned.reaches_border(np.ones(7, int), np.float32([u, v, scale]))
    np.testing.assert_array_equal(found, [False, True, True, True, True, False, True])


def test_boxes_are_in_one_place_by_their_iou(learned):
    """The second object's box, 14 x 22 pixels, moved by 0, 2, 4 and 14 pixels."""
    u = np.array([40.0, 42, 44, 54, np.nan])
    substates = np.float32([u, np.full(5, 30), np.ones(5)])
    found = learned.same_place(np.ones(5, int), substates)[0]
    iou = np.array([14, 12, 10, 0]) / np.array([14, 16, 18, 28])
    np.testing.assert_allclose(found[:4], np.clip((iou - 0.4) / 0.3, 0, 1), atol=1e-5)
    assert found[4] == 0


def numpy_features(frame, box, factor):
    """Colours [2, 110] and cells [2, 4, 4, 8] of one box, by OpenCV and loops."""
    padded = cv2.copyMakeBorder(
        frame, 0, -HEIGHT % factor, 0, -WIDTH % factor, cv2.BORDER_REPLICATE
    )
    size = (padded.shape[1] // factor, padded.shape[0] // factor)
    small = cv2.resize(padded.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    bins = float_bins(np.rint(small).astype(np.uint8))
    grey = small / 255 @ np.float32([0.299, 0.587, 0.114])
    kernel = np.float32([[-0.5, 0, 0.5]])
    across, down = (
        cv2.filter2D(grey, -1, k, borderType=cv2.BORDER_REPLICATE) for k in (kernel, kernel.T)
    )
    turns = np.arctan2(down, across) / (2 * np.pi) * 8
    votes = np.zeros((*grey.shape, 8))
    for direction in range(8):
        away = np.abs((turns - direction + 4) % 8 - 4)
        votes[..., direction] = np.hypot(across, down) ** 0.5 * np.maximum(1 - away, 0)
    x, y, w, h = np.asarray(box) / factor

    def inside(picture, top, bottom, left, right):
        rows = np.clip(np.floor(np.array([top, bottom]) + 0.5), 0, len(picture)).astype(int)
        columns = np.clip(np.floor(np.array([left, right]) + 0.5), 0, picture.shape[1]).astype(int)
        return picture[slice(*rows), slice(*columns)]

    colours = np.zeros((2, 110))
    for band in range(2):
        top, bottom = y + h * band / 2, y + h * (band + 1) / 2
        counts = np.bincount(inside(bins, top, bottom, x, x + w).ravel(), minlength=110)
        sides = np.floor(np.array([[x, x + w], [top, bottom]]) + 0.5)
        colours[band] = np.sqrt(counts / np.diff(sides).prod() / 2)
    cells = np.zeros((4, 4, 8))
    for i, j in np.ndindex(4, 4):
        sides = y + h * i / 4, y + h * (i + 1) / 4, x + w * j / 4, x + w * (j + 1) / 4
        mean = inside(votes, *sides).sum(axis=(0, 1)) / (w * h / 16)
        cells[i, j] = np.sqrt(mean / (mean.sum() + 0.03)) / 4
    return colours, cells


@pytest.mark.parametrize(
    "box",
    [*BOXES, (22.6, 9.3, 48.4, 44.0), (58.2, 37.1, 16.8, 26.4), (-13.0, 45.0, 44.0, 40.0)],
)
def test_scores_are_linear_in_features_of_opencv(learned, box):
    number, substate = substates_of([box])
    lookup = np.asarray(learned.bin_lookup)
    factor = learned.factors[int(learned.level[number[0]])]
    assert factor == (2, 1)[number[0]]
    colours, cells = numpy_features(FRAME, box, factor)
    weights = np.asarray(learned.colour_weights)[number[0]]
    weights = np.append(weights, np.zeros((2, 1)), axis=1)[:, np.minimum(lookup, weights.shape[1])]
    expected = np.asarray(learned.offset)[number[0]] + (weights * colours).sum()
    expected += (np.asarray(learned.gradient_weights)[number[0]] * cells).sum()
    seen = _OBSERVE(learned, FRAME)
    score = scores(learned, seen, number, substate)
    # Votes are rounded to 1 / 255, and weights are some tenths.
    np.testing.assert_allclose(score, expected, atol=0.01)
    smooth = dataclasses.replace(learned, interpolation="bilinear")
    np.testing.assert_allclose(_SCORES(smooth, seen, number, substate), expected, atol=0.15)


def test_ridge_is_the_solution_of_the_normal_equations():
    rng = np.random.default_rng(1)
    features, labels = rng.normal(size=(40, 70)), rng.normal(size=40)
    with jax.enable_x64(True):
        weights, offset, residual = map(np.asarray, jax.jit(ridge)(features, labels))
    # With a free offset: features and labels less their means.
    centred = features - features.mean(axis=0)
    expected = np.linalg.solve(centred.T @ centred + 0.5 * np.eye(70), centred.T @ labels)
    np.testing.assert_allclose(weights, expected, atol=1e-10)
    left = labels - features @ weights - offset
    assert abs(left.mean()) < 1e-10
    assert residual == pytest.approx(np.sqrt((left**2).mean()))


def test_labels_are_overlaps():
    boxes, labels = training_boxes()
    assert len(boxes) == 143
    assert labels.max() == labels[np.all(boxes == [0, 0, 1, 1], axis=1)] == 1
    ours = np.column_stack([boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, 2:]])
    truth = np.broadcast_to([-0.5, -0.5, 1, 1], ours.shape)
    np.testing.assert_allclose(labels, jax.jit(jaxpf.measures.iou)(ours, truth), atol=1e-6)


def test_the_score_peaks_where_the_object_went_over_another_background(learned):
    frame = blocks(7)
    moved = np.array([[35, 22], [8, 9]])
    for (x, y), box in zip(moved, BOXES.astype(int), strict=True):
        frame[y : y + box[3], x : x + box[2]] = FRAME[
            box[1] : box[1] + box[3], box[0] : box[0] + box[2]
        ]
    seen = _OBSERVE(learned, frame)
    for number, (place, box) in enumerate(zip(moved, BOXES, strict=True)):
        shifts = np.stack(np.meshgrid(*[np.arange(-24, 25, 2)] * 2), -1).reshape(-1, 2)
        centres = place + box[2:] / 2 + shifts
        score = scores(learned, seen, number, np.column_stack([centres, np.ones(len(shifts))]).T)
        np.testing.assert_allclose(shifts[np.argmax(score)], 0, atol=2)
        far = np.abs(shifts).max(axis=1) > 20
        assert score.max() > 0.55 > 0.5 > np.max(score[far])


def composed_of(frame, box, shift):
    """The whole frame, with the object before another part of it."""
    corner, shape = np.zeros(2, int), frame.shape[:2]
    return jax.jit(before_background, static_argnums=4)(frame, box, shift, corner, shape)


def test_an_object_stays_before_another_background():
    box, shift = np.array([20.0, 12.0, 44.0, 40.0]), np.array([0.5, -0.25])
    composed, behind = composed_of(FRAME, box, shift), np.roll(FRAME, (-10, 22), axis=(0, 1))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    away = np.hypot((columns - 42) / 22, (rows - 32) / 20)  # 1 on the ellipse
    np.testing.assert_array_equal(composed[away < 0.9], FRAME[away < 0.9])
    np.testing.assert_array_equal(composed[away > 1.1], behind[away > 1.1])
    window = jax.jit(before_background, static_argnums=4)(
        FRAME, box, shift, np.array([7, 9]), (30, 40)
    )
    np.testing.assert_array_equal(window, composed[9:39, 7:47])


@pytest.mark.slow
def test_what_is_learned_in_windows_is_the_regression_on_whole_frames():
    frame = blocks(3, 200, 300)
    # No edge of a cell lies half way between two lines, where it might fall on either.
    boxes = np.array([[281.13, 171.07, 14.31, 22.43], [100.17, 61.09, 44.29, 40.37]])
    learned = discriminative(frame, boxes)
    shifts, labels = training_boxes()
    for number, box in enumerate(boxes):
        centres = box[:2] + box[2:] * (0.5 + shifts[:, :2])
        substates = np.column_stack([centres, shifts[:, 2]]).T
        left = [
            labels
            - scores(learned, _OBSERVE(learned, composed_of(frame, box, shift)), number, substates)
            for shift in np.array(BACKGROUNDS)
        ]
        assert np.mean(left) == pytest.approx(0, abs=1e-5)
        assert np.sqrt(np.mean(np.square(left))) == pytest.approx(
            float(learned.residual[number]), rel=1e-4
        )


@pytest.mark.slow
def test_the_score_follows_the_object_and_does_not_stay_with_the_wall_behind_it():
    rows, columns = 100, 160

    def walker(seed, wall, x):
        """An ellipse that leaves 43% of its box, 30 x 40, to the wall."""
        down, across = np.mgrid[:rows, :columns] + 0.5
        inside = np.hypot((across - x) / (0.85 * 15), (down - 50) / (0.85 * 20)) < 1
        picture = np.roll(blocks(100 + seed, rows, columns), x - 75, axis=1)
        return np.where(inside[..., None], picture, wall)

    for seed in range(3):
        wall = blocks(seed, rows, columns)
        likelihood = discriminative(walker(seed, wall, 75), [[60.0, 30.0, 30.0, 40.0]])
        seen = _OBSERVE(likelihood, walker(seed, wall, 110))
        there, left = scores(likelihood, seen, 0, np.array([[110.0, 50, 1], [75, 50, 1]]).T)
        assert there > left + 0.1  # .15 and more; at most .04 learned before one background


@pytest.mark.slow
def test_the_gradient_is_that_of_the_value_in_double_precision():
    with jax.enable_x64(True):
        smooth = discriminative(
            FRAME, BOXES, sharpness=4.0, interpolation="bilinear", background_frames=FRAME[None]
        )
        seen = _OBSERVE(smooth, FRAME)
        points = [[43.3, 30.2, 1.07], [40.1, 36.4, 0.93], [66.4, 50.8, 1.1], [300.0, 20.0, 1.0]]
        numbers, x = np.array([0, 0, 1, 0]), np.array(points).T

        @jax.jit
        @jax.value_and_grad
        def value_and_gradient(x):
            return jnp.sum(smooth.log_prob_all(seen, numbers, x))

        value, gradient = map(np.asarray, value_and_gradient(x))
        assert value.dtype == np.float64
        assert np.isfinite(gradient).all()
        assert np.abs(gradient[:, :3]).min() > 0
        np.testing.assert_array_equal(gradient[:, 3], 0)  # far outside
        for place in np.ndindex(3, 3):
            step = np.zeros_like(x)
            step[place] = 1e-5
            change = float(value_and_gradient(x + step)[0] - value_and_gradient(x - step)[0])
            assert gradient[place] == pytest.approx(change / 2e-5, rel=1e-4, abs=1e-6)
        # A ratio of likelihoods: to boxes anywhere, on average.
        usual = np.clip(np.asarray(smooth.background[0]), -0.2, 1.2)
        trust = 4 / max(float(smooth.residual[0]), 0.03)
        at_best = jax.jit(smooth.log_prob)(seen, np.int32(0), x[:, 0])
        score = np.clip(_SCORES(smooth, seen, numbers, x)[0], -0.2, 1.2)
        expected = trust * score - np.log(np.mean(np.exp(trust * usual)))
        assert float(at_best) == pytest.approx(float(expected), rel=1e-6)


def test_log_odds_fall_off_the_object_and_where_another_place_looks_better(learned):
    def odds(frame, substates):
        return np.asarray(
            _LOG_ODDS(learned, _OBSERVE(learned, frame), np.arange(2), substates.astype(np.float32))
        )

    centres = np.column_stack([BOXES[:, :2] + BOXES[:, 2:] / 2, np.ones(2)]).T
    here = odds(FRAME, centres)
    assert (here > 3).all()
    # Other blocks of the same colours still resemble the object that covers a quarter of it.
    assert (odds(blocks(7), centres) < here - 3).all()
    assert (odds(np.full_like(FRAME, 128), centres) < -1).all()
    # The second object once more in the frame, where the grid has a box.
    twice, (x, y, w, h) = FRAME.copy(), BOXES[1].astype(int)
    left, top = round(2.5 * WIDTH / 12) - w // 2, round(2.5 * HEIGHT / 12) - h // 2
    twice[top : top + h, left : left + w] = FRAME[y : y + h, x : x + w]
    again = odds(twice, centres)[1]
    seen = _OBSERVE(learned, twice)
    place = np.array([[2.5 * WIDTH / 12], [2.5 * HEIGHT / 12], [1.0]])
    best, own = scores(learned, seen, 1, np.hstack([place, centres[:, 1:]]))
    assert best > 0.4
    assert again == pytest.approx(11.5 * (own - best / 2 - 0.12), abs=1e-3)
    assert again < here[1] - 1


def test_boxes_that_are_none_have_no_likelihood(learned):
    seen = _OBSERVE(learned, FRAME)
    substates = np.array([[40.0, 30, 0.01], [40, 30, 20], [np.nan, 30, 1], [40, 30, 1]]).T
    log_probs = _LOG_PROBS(learned, seen, np.zeros(4, int), substates.astype(np.float32))
    assert np.isneginf(log_probs[:2]).all()
    assert np.isnan(log_probs[2])
    assert np.isfinite(log_probs[3])
