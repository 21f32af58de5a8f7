"""Estimates and differences over runs: values, tests, and what too few runs show."""

import math

import numpy as np
import pytest
from scipy import stats

from jaxpf.evaluation.measuring import estimates
from jaxpf.measures import mean_interval

SHARES = (0.0, 1.0)


def paired(first, second):
    """Differences of values ``[R, P]`` with equal weights."""
    ones = np.ones_like(first)
    return (first, ones), (second, ones)


@pytest.mark.slow
@pytest.mark.statistical
def test_interval_of_the_rate_over_all_objects_covers():
    """Objects that share their luck: the interval covers, that of independent trials does not."""
    random = np.random.default_rng(1)
    runs, objects, repetitions = 50, 6, 100
    luck = random.beta(1.6, 0.4, (repetitions, runs, 1))  # mean .8, correlation 1 / 3 within a run
    outcomes = (random.random((repetitions, runs, objects)) < luck).astype(float)
    covered, naive = 0, 0
    for each in outcomes:
        found = estimates.estimate(each, np.ones_like(each), SHARES)
        covered += found.lower[-1] <= 0.8 <= found.upper[-1]
        plain = mean_interval(each.ravel(), bounds=SHARES)
        naive += plain.lower <= 0.8 <= plain.upper
    error = math.sqrt(0.95 * 0.05 / repetitions)
    assert covered / repetitions > 0.95 - 4 * error
    assert naive / repetitions < 0.95 - 4 * error


def test_objects_that_always_agree_add_no_certainty():
    outcomes = np.repeat((np.arange(40) % 4 == 0)[:, None], 5, axis=1).astype(float)
    found = estimates.estimate(outcomes, np.ones_like(outcomes), SHARES)
    np.testing.assert_allclose(found.lower, found.lower[0])
    low, high = stats.binomtest(10, 40).proportion_ci()
    assert (found.lower[-1], found.upper[-1]) == pytest.approx((low, high), abs=0.01)


def test_values_without_bounds_are_medians_over_runs():
    errors = np.array([[1.0, 5.0], [2.0, math.nan], [900.0, 6.0], [3.0, 7.0]])
    found = estimates.estimate(errors, np.where(np.isfinite(errors), 2.0, 0.0), None)
    assert found.value.tolist() == [2.5, 6, 4]  # of the runs: 3, 2, 453 and 5
    assert found.runs.tolist() == [4, 3, 4]
    assert np.isnan(found.lower).all()  # six would have an interval


@pytest.mark.parametrize(("gained", "lost"), [(12, 2), (0, 5), (3, 3), (0, 0), (1, 0), (90, 60)])
def test_rates_are_tested_by_mcnemar(gained, lost):
    ours = np.repeat([1.0, 0.0, 1.0], [gained, lost, 10])[:, None]
    theirs = np.repeat([0.0, 1.0, 1.0], [gained, lost, 10])[:, None]
    found = estimates.difference(*paired(ours, theirs), SHARES)
    total = gained + lost
    expected = stats.binomtest(gained, total).pvalue if total else 1.0
    assert found.p == pytest.approx([expected] * 2, rel=1e-9)
    assert (found.gained[0], found.lost[0]) == (gained, lost)
    assert found.value[0] == pytest.approx((gained - lost) / (total + 10))


def test_holm_by_hand():
    adjusted = estimates.holm([0.01, 0.04, math.nan, 0.03, 0.005])
    np.testing.assert_allclose(adjusted, [0.03, 0.06, math.nan, 0.06, 0.02])
    assert estimates.holm([0.9, 0.8]).tolist() == [1.0, 1.0]


KINDS = {
    "shares": (lambda random: random.normal(0.05, 0.1, 15), SHARES),
    "shares of three": (lambda random: random.normal(0.3, 0.1, 3), SHARES),
    "rates": (lambda random: np.r_[np.ones(9), np.zeros(6)], SHARES),
    "errors": (lambda random: random.normal(0.5, 1, 15), None),
    "errors, many equal": (lambda random: np.r_[np.ones(7), np.zeros(9)], None),
}


@pytest.mark.parametrize("kind", KINDS)
def test_p_is_below_what_the_interval_leaves_out_where_it_excludes_0(kind):
    draw, bounds = KINDS[kind]
    gain = draw(np.random.default_rng(2))
    theirs = np.where(gain == np.round(gain), 0.0, 0.4)[:, None]
    runs = paired(theirs + gain[:, None], theirs)
    p = estimates.difference(*runs, bounds).p[0]
    for level, excluded in ((1 - p * 1.001, True), (1 - p * 0.999, False)):
        if 0 < level < 1:
            found = estimates.difference(*runs, bounds, level=level)
            assert (found.lower[0] > 0) == excluded


def test_paired_means_are_tested_nearly_as_by_student():
    random = np.random.default_rng(2)
    theirs = random.uniform(0.2, 0.6, (15, 1))
    ours = theirs + random.normal(0.05, 0.1, (15, 1))
    found = estimates.difference(*paired(ours, theirs), SHARES)
    test = stats.ttest_rel(ours[:, 0], theirs[:, 0])
    for place in (0, 1):  # the object, and all of one
        assert found.value[place] == pytest.approx(np.mean(ours - theirs))
        assert found.p[place] == pytest.approx(test.pvalue, rel=0.15)
        assert found.lower[place] == pytest.approx(test.confidence_interval().low, abs=0.003)


def test_medians_of_differences_have_the_sign_test():
    ours, theirs = np.arange(12.0)[:, None], np.full((12, 1), 2.5)
    found = estimates.difference(*paired(ours, theirs), None)
    assert found.value.tolist() == [3, 3]
    assert found.p[0] == pytest.approx(stats.binomtest(3, 12).pvalue)
    assert (found.lower[0], found.upper[0]) == (2 - 2.5, 9 - 2.5)


def test_equal_runs_do_not_differ():
    values = np.full((5, 1), 0.1)
    found = estimates.difference(*paired(values, values), SHARES)
    assert found.value.tolist() == [0, 0]
    assert found.p.tolist() == [1, 1]
    different = estimates.difference(*paired(values, values + 0.5), SHARES)
    assert (different.p < 0.05).all()
