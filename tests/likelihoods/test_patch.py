"""Windows of pixels, of boxes and of points: eskil2014's formula, wherever the window lies."""

import jax
import numpy as np
import pytest

from jaxpf.contract.calls import has_log_odds
from jaxpf.likelihoods import patch, windows
from jaxpf.likelihoods.patch import windows_from_pictures

HEIGHT, WIDTH, COUNT = 40, 60, 51
RNG = np.random.default_rng(0)
FRAME, OTHER = RNG.integers(20, 256, (2, HEIGHT, WIDTH, 3), dtype=np.uint8)
POSES, SIZES = np.array([[20.0, 20, 0.3], [45, 25, -1.2]]), np.array([[14.0, 10], [9, 16]])
#: The second one's window leaves the frame.
POINTS = np.array([[20.3, 15.9], [5.0, 38.5]])


@jax.jit
def log_prob_all(likelihood, frame, partition, substates):
    return likelihood.log_prob_all(likelihood.observe(frame), partition, substates)


@jax.jit
def log_odds_all(likelihood, frame, partition, substates):
    return likelihood.log_odds_all(likelihood.observe(frame), partition, substates)


def log_prob(likelihood, frame, substates, partition=0):
    """Log-likelihoods of up to 51 substates [N, D], filled up: tests then share a program."""
    more = COUNT - len(substates)
    partition = np.pad(np.broadcast_to(partition, len(substates)), (0, more), mode="edge")
    filled = np.pad(np.asarray(substates, np.float32), ((0, more), (0, 0)), mode="edge")
    return np.asarray(log_prob_all(likelihood, frame, partition, filled.T))[: len(substates)]


def colours_at(frame, x, y):
    """The colours of the pixels at places, black outside the frame."""
    x, y = (np.floor(place).astype(int) + 1 for place in (x, y))
    return np.pad(frame.astype(float), ((1, 1), (1, 1), (0, 0)))[
        np.clip(y, 0, HEIGHT + 1), np.clip(x, 0, WIDTH + 1)
    ]


def shown_in_box(frame, substate, size, window=(5, 4)):
    u, v, scale, theta = substate
    a, b = ((np.arange(n) + 0.5) / n - 0.5 for n in window)
    a, b = np.meshgrid(a * size[0] * scale, b * size[1] * scale)
    x, y = u + np.cos(theta) * a - np.sin(theta) * b, v + np.sin(theta) * a + np.cos(theta) * b
    return colours_at(frame, x, y)


def shown_at_point(frame, place):
    x, y = np.meshgrid(*(coordinate + np.arange(-4, 5) for coordinate in place))
    return colours_at(frame, x, y)


def squares(reference, seen):
    return (reference / reference.mean() - seen / max(seen.mean(), 1)) ** 2


def test_boxes_have_the_papers_formula_and_are_sampled_place_by_place():
    rng = np.random.default_rng(1)
    likelihood = patch(FRAME, POSES, SIZES, sigma=0.3, window=(5, 4))
    at = rng.uniform([-5, -5, 0.5, -4], [WIDTH + 5, HEIGHT + 5, 2, 4], (COUNT, 4))
    at[0] = -500, 20, 1, 0  # wholly outside
    partition, starts = np.arange(COUNT) % 2, np.insert(POSES, 2, 1, axis=1)
    expected = [
        -squares(*(shown_in_box(*x, SIZES[p]) for x in ((FRAME, starts[p]), (OTHER, place)))).mean()
        for p, place in zip(partition, at, strict=True)
    ]
    found = log_prob(likelihood, OTHER, at, partition)
    # In float32 a place on the edge of a pixel may fall to its other side.
    assert np.isclose(found, np.array(expected) / 0.09, rtol=1e-3, atol=1e-3).mean() > 0.9


@pytest.mark.parametrize("norm", ["mean", "sum"])
@pytest.mark.parametrize("places", [[[25.0, 20.0], [30.9, 19.1]], [[0.2, 3.0], [59.9, 39.9]]])
def test_points_have_the_papers_formula(norm, places):
    likelihood = windows(FRAME, POINTS, sigma=0.3, window=(9, 9), norm=norm)
    found = log_prob(likelihood, OTHER, places, np.arange(2))
    for point, place, value in zip(POINTS, places, found, strict=True):
        terms = squares(shown_at_point(FRAME, point), shown_at_point(OTHER, place))
        expected = -(terms.mean() if norm == "mean" else terms.sum()) / 0.09
        np.testing.assert_allclose(value, expected, rtol=2e-4)


def test_brightness_does_not_matter_and_the_start_is_the_best_place():
    steps = RNG.normal(size=(COUNT - 1, 3)) * [3, 3, 0.3]
    boxes = np.insert(POSES[0] + np.vstack([np.zeros(3), steps]), 2, 1, axis=1)
    around = np.stack(np.meshgrid(np.arange(17, 24), np.arange(12, 19)), -1).reshape(-1, 2) + 0.5
    start = int(np.flatnonzero(np.all(np.floor(around) == [20, 15], axis=1))[0])
    for likelihood, substates, best in (
        (patch(FRAME // 2, POSES, SIZES, window=(5, 4)), boxes, 0),
        (windows(FRAME // 2, POINTS, window=(9, 9)), around, start),
    ):
        found = log_prob(likelihood, FRAME // 2, substates)
        assert np.argmax(found) == best
        assert found[best] == pytest.approx(0, abs=1e-6)
        bright = log_prob(likelihood, FRAME // 2 * 2, substates)
        np.testing.assert_allclose(found, bright, rtol=1e-4, atol=1e-4)


def test_black_windows_and_places_that_are_none():
    likelihood = patch(FRAME, POSES, SIZES, window=(5, 4))
    nan, inf = np.nan, np.inf
    at = [(20, 20, 1, 0), (-1000, 20, 1, 0), (1e9, 20, 1, 2), (20, 3e30, 1, 0)]
    dark = log_prob(likelihood, 0 * FRAME, at)
    reference = np.asarray(likelihood.references, float)[0]
    np.testing.assert_allclose(dark, -np.mean(reference**2) / 0.01, rtol=1e-5)
    at = [(nan, 20, 1, 0), (20, 20, 1, inf), (20, 20, 0.01, 0), (20, 20, -1, 0)]
    np.testing.assert_array_equal(log_prob(likelihood, FRAME, at), [nan, nan, -inf, -inf])
    points = windows(FRAME, POINTS, window=(9, 9))
    found = log_prob(points, FRAME, [[nan, 3.0], [1e30, -1e30], [20.0, inf]])
    np.testing.assert_array_equal(np.isnan(found), [True, False, True])


def shown(frame, points, window=(9, 9)):
    """A function of estimates [P, 2] that returns log odds [P] in a frame."""
    likelihood = windows(frame, points, window=window)

    def log_odds(seen, estimates):
        numbers = np.arange(len(estimates))
        estimates = np.asarray(estimates, np.float32).T
        return np.asarray(log_odds_all(likelihood, seen, numbers, estimates))

    return log_odds


def test_log_odds_fall_off_the_point_and_where_it_leaves_its_neighbours():
    points = np.array([[15.5, 15.5], [25.5, 15.5], [15.5, 25.5], [25.5, 25.5]])
    log_odds = shown(FRAME, points)
    moved = np.roll(FRAME, (3, 4), axis=(0, 1))
    followed = log_odds(moved, points + np.array([4, 3]))
    assert np.all(followed > 3)
    # The first point alone is left behind, where the frame shows something else.
    left = log_odds(moved, points + np.array([[0, 0], [4, 3], [4, 3], [4, 3]]))
    assert left[0] < -1
    np.testing.assert_allclose(left[1:], followed[1:], atol=0.1)  # the median forgives one
    # The match is as good as before, but the first point alone seems to move.
    stretched = np.array(FRAME)
    stretched[11:20, 31:40] = FRAME[11:20, 11:20]
    apart = log_odds(stretched, points + np.array([[20, 0], [0, 0], [0, 0], [0, 0]]))
    still = log_odds(FRAME, points)
    assert apart[0] < still[0] - 2.5


@pytest.mark.parametrize("contrast", [1.0, 0.2])
def test_a_twentieth_of_other_places_matches_better_than_e(contrast):
    # Log odds of a single point are above their constant where d < e, whatever the contrast.
    noise = RNG.normal(128, 60 * contrast, (2, 200, 300, 3)).clip(0, 255).astype(np.uint8)
    likelihood = windows(noise[0], [[150.5, 100.5]], window=(9, 9))
    places = np.stack(np.meshgrid(np.arange(5.5, 295, 9), np.arange(5.5, 195, 9)), -1)
    places = places.reshape(-1, 2).astype(np.float32)
    numbers = np.zeros(len(places), int)
    odds = np.asarray(log_odds_all(likelihood, noise[1], numbers, places.T))
    share = np.mean(odds > -1.1)
    # Both sides are estimated from about as many disjoint windows.
    error = np.sqrt(0.05 * 0.95 * 2 / len(places))
    assert abs(share - 0.05) < 4.5 * error
    point = np.array([[150.5], [100.5]], np.float32)
    at_point = log_odds_all(likelihood, noise[0], numbers[:1], point)
    assert at_point[0] > np.max(odds) + 3


def test_without_surroundings_there_are_no_log_odds():
    pictures = [FRAME[:9, :9], FRAME[9:18, :9]]
    learned = windows_from_pictures(pictures)
    assert not has_log_odds(learned)
    assert has_log_odds(windows(FRAME, POINTS, window=(9, 9)))
    whole = windows(FRAME[:9, :9], [[4.5, 4.5]], window=(9, 9))
    assert not has_log_odds(whole)
