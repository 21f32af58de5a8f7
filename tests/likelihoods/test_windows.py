"""The window likelihood of points against a plain computation, and what it refuses."""

import jax
import numpy as np
import pytest

from jaxpf.contract.calls import has_log_odds
from jaxpf.likelihoods import windows
from jaxpf.likelihoods.patch import windows_from_pictures

RNG = np.random.default_rng(0)
FRAME = RNG.integers(20, 256, (40, 60, 3), dtype=np.uint8)
OTHER = RNG.integers(20, 256, (40, 60, 3), dtype=np.uint8)
POINTS = np.array([[20.3, 15.9], [5.0, 38.5]])  # the second one's window leaves the frame
COUNT = 17 * 16


@jax.jit
def log_prob_all(likelihood, frame, points, places):
    return likelihood.log_prob_all(likelihood.observe(frame), points, places)


@jax.jit
def log_prob_of_one(likelihood, frame, point, place):
    return likelihood.log_prob(likelihood.observe(frame), point, place)


@jax.jit
def log_odds_all(likelihood, frame, points, places):
    return likelihood.log_odds_all(likelihood.observe(frame), points, places)


def log_prob(likelihood, frame, places, points=0):
    """Log-likelihoods of places [N, 2], filled up to 272: tests then share a program."""
    more = COUNT - len(places)
    points = np.pad(np.broadcast_to(points, len(places)), (0, more), mode="edge")
    filled = np.pad(np.asarray(places, np.float32), ((0, more), (0, 0)), mode="edge")
    return np.asarray(log_prob_all(likelihood, frame, points, filled.T))[: len(places)]


def cut(frame, x, y, reach):
    padded = np.pad(frame.astype(float), ((20, 20), (20, 20), (0, 0)))
    row, column = int(np.floor(y)) + 20, int(np.floor(x)) + 20
    return padded[row - reach : row + reach + 1, column - reach : column + reach + 1]


@pytest.mark.parametrize("norm", ["mean", "sum"])
@pytest.mark.parametrize("places", [[[25.0, 20.0], [30.9, 19.1]], [[0.2, 3.0], [59.9, 39.9]]])
def test_it_is_equation_7(norm, places):
    likelihood = windows(FRAME, POINTS, sigma=0.3, window=(9, 9), norm=norm)
    found = log_prob(likelihood, OTHER, places, np.arange(2))
    for point, place, value in zip(POINTS, places, found, strict=True):
        reference, seen = cut(FRAME, *point, 4), cut(OTHER, *place, 4)
        squares = (reference / reference.mean() - seen / seen.mean()) ** 2
        expected = -(squares.mean() if norm == "mean" else squares.sum()) / 0.09
        np.testing.assert_allclose(value, expected, rtol=2e-4)
    one = log_prob_of_one(likelihood, OTHER, 1, np.array(places[1]))
    np.testing.assert_allclose(one, found[1], rtol=1e-5)


def test_brightness_does_not_matter_and_the_place_does():
    likelihood = windows(FRAME, POINTS, window=(9, 9))
    darker = (FRAME // 2).astype(np.uint8)
    around = np.stack(np.meshgrid(np.arange(12, 29), np.arange(11, 27)), -1).reshape(-1, 2) + 0.5
    found = log_prob(likelihood, darker, around)
    np.testing.assert_array_equal(np.floor(around[int(np.argmax(found))]), [20, 15])
    assert np.max(found) > -0.05


def test_places_that_are_no_numbers_or_far_away_are_told():
    likelihood = windows(FRAME, POINTS, window=(9, 9))
    found = log_prob(likelihood, FRAME, [[np.nan, 3.0], [1e30, -1e30], [20.0, np.inf]])
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
