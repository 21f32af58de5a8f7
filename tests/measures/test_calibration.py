"""Regions that hold the truth as often as they say, and scores that tell where they do not."""

import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.measures import crps, log_score, mean_interval, pit_values
from jaxpf.measures.calibration import Reliability, confidence_counts

N = 40_000


@pytest.fixture(scope="module")
def drawn():
    """Estimates whose error has the spread that they say."""
    rng = np.random.default_rng(0)
    spread = rng.uniform(0.5, 4.0, N)
    return spread * rng.normal(size=N), spread


@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
def test_regions_of_an_honest_spread_hold_the_truth_so_often(drawn, level):
    offset, spread = drawn
    error = np.sqrt(level * (1 - level) / N)

    def share(spread):
        return np.mean(np.abs(2 * pit_values(offset, spread) - 1) <= level)

    assert abs(share(spread) - level) < 4 * error
    assert share(spread / 1.1) < level - 4 * error
    assert share(1.1 * spread) > level + 4 * error


def test_transforms_are_uniform_and_on_the_side_of_the_truth(drawn):
    found = pit_values(*drawn)
    counts = np.histogram(found, 20, (0, 1))[0]
    assert np.sum((counts - N / 20) ** 2 / (N / 20)) < 43.8  # chi-square of 19, p = .001
    assert pit_values(3.0, 1.0) < 0.01  # the truth lies far below the estimate


def test_crps_is_the_integral_of_the_squared_difference():
    grid = np.linspace(-40, 40, 400_001)
    from scipy.stats import norm

    for offset, spread in ((0.0, 1.0), (2.5, 0.7), (-6.0, 3.0)):
        difference = norm.cdf(grid, scale=spread) - (grid >= -offset)
        np.testing.assert_allclose(
            crps(offset, spread), np.trapezoid(difference**2, grid), rtol=1e-4
        )
        np.testing.assert_allclose(log_score(offset, spread), norm.logpdf(offset, scale=spread))


def test_honest_spreads_score_best(drawn):
    offset, spread = drawn
    for score, sign in ((crps, -1), (log_score, 1)):
        best = sign * score(offset, spread)
        for factor in (0.8, 1.25):
            gain = best - sign * score(offset, factor * spread)
            assert gain.mean() > 4 * gain.std() / np.sqrt(N)


def test_what_is_not_known_is_no_number():
    offset, spread = [0.0, np.nan, np.inf, 1.0], [0.0, 1.0, 1.0, np.nan]
    for measure in (pit_values, crps, log_score):
        assert np.isnan(measure(offset, spread)).all()
        with pytest.raises(InputError, match="spread=-1 is negative; give standard deviations"):
            measure([0.0, 1.0], [1.0, -1.0])


def test_reliability_of_streamed_runs_is_that_of_pooled_frames():
    """Shares are weighted means over runs with their interval, however runs are divided."""
    random = np.random.default_rng(4)
    confidence = random.random((40, 30, 2))
    on_object = (random.random(confidence.shape) < confidence).astype(float)
    on_object[:, ::7] = np.nan
    confidence[3, 5] = np.nan
    counts = confidence_counts(confidence, on_object)
    streamed = Reliability()
    for first in range(0, 40, 16):
        streamed.add(counts[first : first + 16])
    known = np.isfinite(confidence) & np.isfinite(on_object)
    assert streamed.frames[-1] == known.sum()
    bins = np.minimum((confidence * 5).astype(float), 4.999)
    shares = streamed.shares()
    for place in range(5):
        inside = known & (np.floor(bins) == place)
        frames = inside.sum(axis=(1, 2))
        values = np.where(inside, on_object, 0).sum(axis=(1, 2)) / np.maximum(frames, 1)
        expected = mean_interval(values, frames, bounds=(0, 1))
        for ours, theirs in zip(shares, expected, strict=True):
            assert ours[place] == pytest.approx(float(theirs), rel=1e-4)
        assert shares.lower[place] < 0.1 + 0.2 * place < shares.upper[place] + 0.05
    pairs = confidence[known & (on_object == 1)][:, None] - confidence[known & (on_object == 0)]
    assert streamed.area() == pytest.approx(np.mean(pairs > 0), abs=0.01)


def test_levels_in_hundredths_count_whole_bins():
    confidence = (np.arange(100) / 100)[None]
    counts = confidence_counts(confidence, np.zeros((1, 100)))
    assert counts[0, 0].tolist() == 100 * [1]
    reliability = Reliability()
    reliability.add(counts)
    assert reliability.silent() == 0.5
