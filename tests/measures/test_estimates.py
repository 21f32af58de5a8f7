"""Rates, differences and their intervals: as published, and against SciPy."""

import math

import numpy as np
import pytest
from scipy import stats

from jaxpf.measures import estimates, mean_interval, wilson_interval


def test_all_objects_together_have_the_certainty_of_runs():
    """Objects that always agree add nothing; those that are independent count each."""
    outcomes = np.arange(40) % 4 == 0
    alike = np.repeat(outcomes[:, None], 5, axis=1).astype(float)
    wilson = wilson_interval(10, 40)
    for got, wanted in zip(estimates.rate(alike)[2:4], wilson[2:], strict=True):
        assert got[-1] == pytest.approx(float(wanted), rel=1e-5)
    # Never a failure: no spread to learn from, so as if all objects were alike.
    perfect = estimates.rate(np.ones((40, 5)))
    assert perfect.lower[-1] == pytest.approx(float(wilson_interval(40, 40).lower))
    # Independent ones: close to the 200 trials that they are.
    random = np.random.default_rng(0).random((40, 5)) < 0.4
    several = estimates.rate(random.astype(float))
    pooled = wilson_interval(int(random.sum()), 200)
    width = several.upper[-1] - several.lower[-1]
    assert width == pytest.approx(float(pooled.upper - pooled.lower), rel=0.25)


@pytest.mark.statistical
def test_interval_of_the_rate_over_all_objects_covers():
    """Objects that share their luck: the interval covers, that of independent trials does not."""
    random = np.random.default_rng(1)
    runs, objects, repetitions = 50, 6, 300
    covered, naive = 0, 0
    for _ in range(repetitions):
        luck = random.beta(1.6, 0.4, (runs, 1))  # mean .8, correlation 1 / (1 + 2) within a run
        outcomes = (random.random((runs, objects)) < luck).astype(float)
        interval = estimates.rate(outcomes)
        covered += interval.lower[-1] <= 0.8 <= interval.upper[-1]
        plain = wilson_interval(outcomes.sum(), outcomes.size)
        naive += bool(plain.lower <= 0.8 <= plain.upper)
    error = math.sqrt(0.95 * 0.05 / repetitions)
    assert covered / repetitions > 0.95 - 4 * error
    assert naive / repetitions < 0.95 - 4 * error


def test_newcombes_interval_as_published():
    """Newcombe (1998), table II: 36, 12, 2 and 0 pairs of 50."""
    assert estimates.newcombe_interval(36, 12, 2, 0) == pytest.approx((0.0569, 0.3404), abs=5e-5)
    lower, upper = estimates.newcombe_interval(36, 2, 12, 0)
    assert (lower, upper) == pytest.approx((-0.3404, -0.0569), abs=5e-5)


@pytest.mark.parametrize("table", [(5, 0, 0, 5), (0, 10, 0, 0), (10, 0, 0, 0), (0, 5, 5, 0)])
def test_newcombes_interval_at_the_edges(table):
    lower, upper = estimates.newcombe_interval(*table)
    difference = (table[1] - table[2]) / 10
    assert -1 <= lower <= difference <= upper <= 1
    assert upper > lower


@pytest.mark.parametrize(("gained", "lost"), [(12, 2), (0, 5), (3, 3), (0, 0), (1, 0), (90, 60)])
def test_mcnemar_is_the_binomial_test_of_the_pairs_that_differ(gained, lost):
    total = gained + lost
    expected = stats.binomtest(gained, total).pvalue if total else 1.0
    assert estimates.mcnemar_p(gained, lost) == pytest.approx(expected, rel=1e-9)


def test_holm_by_hand():
    adjusted = estimates.holm([0.01, 0.04, math.nan, 0.03, 0.005])
    np.testing.assert_allclose(adjusted, [0.03, 0.06, math.nan, 0.06, 0.02])
    assert estimates.holm([0.9, 0.8]).tolist() == [1.0, 1.0]


def test_paired_means_are_students():
    random = np.random.default_rng(2)
    ours = random.normal(0.3, 1, (15, 1)) + random.normal(0, 3, (15, 1))
    theirs = ours + random.normal(0.4, 1, (15, 1))
    ones = np.ones_like(ours)
    difference = estimates.mean_difference(ours, ones, theirs, ones)
    test = stats.ttest_rel(ours[:, 0], theirs[:, 0])
    interval = test.confidence_interval()
    for place in (0, 1):  # the object, and all of one
        assert difference.value[place] == pytest.approx(np.mean(ours - theirs))
        assert difference.p[place] == pytest.approx(test.pvalue)
        ends = difference.lower[place], difference.upper[place]
        assert ends == pytest.approx((interval.low, interval.high))


def test_error_of_weighted_differences_is_that_of_the_weighted_mean():
    """Against a reference that is the same in every run, only our own error is left."""
    random = np.random.default_rng(3)
    values, weights = random.random((30, 2)), random.integers(0, 9, (30, 2)).astype(float)
    values[weights == 0] = math.nan
    constant = np.full((30, 2), 0.25)
    difference = estimates.mean_difference(values, weights, constant, np.ones((30, 2)))
    wanted = mean_interval(values, weights)
    np.testing.assert_allclose(difference.value[:2], np.asarray(wanted.value) - 0.25, rtol=1e-5)
    np.testing.assert_allclose(difference.standard_error[:2], wanted.standard_error, rtol=1e-5)


def test_equal_runs_do_not_differ():
    values = np.full((5, 1), 0.1)
    difference = estimates.mean_difference(values, values, values, values)
    assert difference.value.tolist() == [0, 0]
    assert difference.p.tolist() == [1, 1]
    different = estimates.mean_difference(values, values, values + 0.5, values)
    assert np.isnan(different.p).all()  # without any spread there is nothing to test by


def test_intervals_of_shares_stay_between_0_and_1():
    """Two runs of a share: the normal interval of .83 reaches far past 1."""
    values = np.array([[0.99, 0.02], [0.67, 0.0]])
    ones = np.ones_like(values)
    shares = estimates.mean(values, ones, shares=True)
    assert estimates.mean(values, ones).upper[0] > 1
    assert estimates.mean(values, ones).lower[1] < 0
    assert (shares.lower >= 0).all()
    assert (shares.upper <= 1).all()
    assert (shares.lower < shares.value).all()
    assert (shares.value < shares.upper).all()


def test_the_interval_of_shares_is_the_normal_one_where_runs_are_many():
    values = np.random.default_rng(0).uniform(0.4, 0.8, (400, 1))
    ones = np.ones_like(values)
    shares, normal = estimates.mean(values, ones, shares=True), estimates.mean(values, ones)
    np.testing.assert_allclose(shares.lower, normal.lower, atol=5e-4)
    np.testing.assert_allclose(shares.upper, normal.upper, atol=5e-4)
