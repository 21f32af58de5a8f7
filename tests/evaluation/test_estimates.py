"""Estimates and differences over runs: values, tests, and what too few runs show."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from jaxpf.evaluation.estimates import difference, estimate, holm, with_all
from jaxpf.measures import difference_interval, mean_interval
from jaxpf.measures.intervals import difference_p_value

SHARES = (0.0, 1.0)


def values_of(measure, values, weights=1.0):
    """Values and weights ``[R, P]`` of objects, and of all together, as columns of a measure."""
    both = with_all(values, np.broadcast_to(weights, values.shape))
    names = [(measure, place) for place in range(both[0].shape[1])]
    columns = pd.MultiIndex.from_tuples(names, names=["measure", "object"])
    return [pd.DataFrame(each, columns=columns) for each in both]


def apart(measure, ours, theirs, **given):
    return difference(values_of(measure, ours)[0], values_of(measure, theirs)[0], **given)


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
        found = estimate(*values_of("success", each)).iloc[-1]
        covered += found.lower <= 0.8 <= found.upper
        plain = mean_interval(each.ravel(), bounds=SHARES)
        naive += plain.lower <= 0.8 <= plain.upper
    error = math.sqrt(0.95 * 0.05 / repetitions)
    assert covered / repetitions > 0.95 - 4 * error
    assert naive / repetitions < 0.95 - 4 * error


def test_objects_that_always_agree_add_no_certainty():
    outcomes = np.repeat((np.arange(40) % 4 == 0)[:, None], 5, axis=1).astype(float)
    found = estimate(*values_of("success", outcomes))
    np.testing.assert_allclose(found.lower, found.lower.iloc[0])
    low, high = stats.binomtest(10, 40).proportion_ci()
    assert (*found.iloc[-1][["lower", "upper"]],) == pytest.approx((low, high), abs=0.01)


def test_values_without_bounds_are_medians_over_runs():
    errors = np.array([[1.0, 5.0], [2.0, math.nan], [900.0, 6.0], [3.0, 7.0]])
    found = estimate(*values_of("centre_error", errors, 2.0))
    assert found.value.tolist() == [2.5, 6, 4]  # of the runs: 3, 2, 453 and 5
    assert found.runs.tolist() == [4, 3, 4]
    assert found.lower.isna().all()  # six would have an interval


def test_differences_are_those_of_the_measures():
    """Of rates and of shares, for each object and for all; ``tests/measures`` proves these."""
    random = np.random.default_rng(2)
    shares = random.uniform(0.2, 0.6, (15, 2))
    others = shares + random.normal(0.05, 0.1, (15, 2))
    for ours, theirs in ((others, shares), (np.round(others + 0.2), np.round(shares))):
        found = apart("success", ours, theirs)
        pair = [np.c_[values, values.mean(axis=1)] for values in (ours, theirs)]
        wanted = difference_interval(*pair, 0.95, SHARES)
        np.testing.assert_allclose(found[[*wanted._fields]].T, wanted)
        np.testing.assert_allclose(found.p, difference_p_value(*pair, SHARES))
        np.testing.assert_array_equal(found.gained, np.sum(pair[0] > pair[1], axis=0))
        np.testing.assert_array_equal(found.lost, np.sum(pair[0] < pair[1], axis=0))


def test_holm_by_hand():
    adjusted = holm([0.01, 0.04, math.nan, 0.03, 0.005])
    np.testing.assert_allclose(adjusted, [0.03, 0.06, math.nan, 0.06, 0.02])
    assert holm([0.9, 0.8]).tolist() == [1.0, 1.0]


KINDS = {
    "errors": lambda random: random.normal(0.5, 1, 15),
    "errors, many equal": lambda random: np.r_[np.ones(7), np.zeros(9)],
}


@pytest.mark.parametrize("kind", KINDS)
def test_p_of_medians_is_below_what_the_interval_leaves_out_where_it_excludes_0(kind):
    gain = KINDS[kind](np.random.default_rng(2))[:, None]
    pair = gain, np.zeros_like(gain)
    p = apart("centre_error", *pair).p.iloc[0]
    for level, excluded in ((1 - p * 1.001, True), (1 - p * 0.999, False)):
        if 0 < level < 1:
            assert (apart("centre_error", *pair, level=level).lower.iloc[0] > 0) == excluded


def test_medians_of_differences_have_the_sign_test():
    found = apart("centre_error", np.arange(12.0)[:, None], np.full((12, 1), 2.5))
    assert found.value.tolist() == [3, 3]
    assert found.p.iloc[0] == pytest.approx(stats.binomtest(3, 12).pvalue)
    assert (found.lower.iloc[0], found.upper.iloc[0]) == (2 - 2.5, 9 - 2.5)


def test_equal_runs_do_not_differ():
    values = np.full((5, 1), 0.1)
    found = apart("success", values, values)
    assert found.value.tolist() == [0, 0]
    assert found.p.tolist() == [1, 1]
    assert (apart("success", values, values + 0.5).p < 0.05).all()
