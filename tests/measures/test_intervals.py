"""Intervals over few units cover the truth as often as they say, or are not given."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.special import betaincinv, ndtr

from jaxpf.measures import (
    difference_interval,
    has_width,
    mean_interval,
    median_interval,
    student_interval,
)

SIZES = (2, 3, 5, 11, 25, 50)
UNIT = (0.0, 1.0)


def lost(rng, shape, tracked, large):
    """Values of which a tenth belong to lost objects."""
    return np.where(rng.random(shape) < 0.1, large, tracked)


def iou(rng, shape, mean=0.7, spread=0.05):
    return np.clip(mean + spread * rng.normal(size=shape), 0, 1)


#: Name -> draw, mean and bounds of single values.
SINGLE = {
    "normal": (lambda rng, s: rng.normal(size=s), 0.0, None),
    "lognormal": (lambda rng, s: rng.lognormal(size=s), math.exp(0.5), None),
    "exponential": (lambda rng, s: rng.exponential(size=s), 1.0, None),
    "few lost, pixels": (
        lambda rng, s: lost(rng, s, 1 + 0.2 * rng.normal(size=s), 20 + 5 * rng.random(s)),
        0.9 + 2.25,
        None,
    ),
    "beta, skewed": (lambda rng, s: rng.beta(9, 0.5, s), 9 / 9.5, UNIT),
    "beta, two modes": (lambda rng, s: rng.beta(0.5, 0.5, s), 0.5, UNIT),
    "0 or 1, .9": (lambda rng, s: 1.0 * (rng.random(s) < 0.9), 0.9, UNIT),
    "0 or 1, .5": (lambda rng, s: 1.0 * (rng.random(s) < 0.5), 0.5, UNIT),
    "few lost, IoU": (lambda rng, s: lost(rng, s, iou(rng, s), 0.0), 0.63, UNIT),
    "shares near 1": (lambda rng, s: rates(rng.random(s), rng, 0.99), 0.99, UNIT),
}


def rates(uniform, rng, mean):
    """Rates of 30 trials that a scene's difficulty, ``uniform``, correlates."""
    return rng.binomial(30, betaincinv(mean / 2, (1 - mean) / 2, uniform)) / 30


def alike(rng, shape):
    """Two uniform values that a scene's difficulty correlates."""
    shared, own = rng.normal(size=shape), rng.normal(size=(2, *shape))
    return ndtr(math.sqrt(0.8) * shared + math.sqrt(0.2) * own)


def rescued(share):
    def draw(rng, shape):
        base = iou(rng, shape, 0.6, 0.15)
        gain = np.where(rng.random(shape) < share, np.minimum(0.6, 1 - base), 0)
        return base + gain, base

    return draw


def rescued_from_zero(rng, shape):
    """8% of the objects are lost by the second method alone."""
    base, place = iou(rng, shape, 0.6, 0.1), rng.random(shape) < 0.08
    return np.where(place, iou(rng, shape), base), np.where(place, 0.0, base)


def successes_rescued(rng, shape):
    luck = rng.random(shape)
    return 1.0 * (luck < 0.9), 1.0 * (luck < 0.82)


def correlated_rates(rng, shape):
    first, second = alike(rng, shape)
    return rates(first, rng, 0.9), rates(second, rng, 0.6)


def correlated_successes(rng, shape):
    first, second = alike(rng, shape)
    return 1.0 * (first < 0.9), 1.0 * (second < 0.6)


def similar_iou(rng, shape):
    base = rng.beta(4, 2, shape)
    return tuple(np.clip(base + 0.05 * rng.normal(size=shape) + shift, 0, 1) for shift in (0.03, 0))


def normal_pairs(rng, shape):
    base = rng.lognormal(size=shape)
    return base + rng.normal(0.3, 1, shape), base


#: Name -> draw of two paired values, and the bounds of each.
PAIRS = {
    "IoU, 8% rescued": (rescued(0.08), UNIT),
    "IoU, 20% rescued": (rescued(0.2), UNIT),
    "IoU, rescued from 0": (rescued_from_zero, UNIT),
    "0 or 1, 8% rescued": (successes_rescued, UNIT),
    "rates": (correlated_rates, UNIT),
    "0 or 1, correlated": (correlated_successes, UNIT),
    "IoU, similar": (similar_iou, UNIT),
    "normal": (normal_pairs, None),
}


def covered(found, truth):
    """Share of the intervals that cover the truth."""
    return float(np.mean((found.lower <= truth + 1e-12) & (found.upper >= truth - 1e-12)))


def least(units, bounds):
    """The coverage that is asked for; None where there must be no interval."""
    if units < 3 or (bounds is None and units < 25):
        return None
    return 0.90 if bounds is None or units < 5 else 0.93


def check_single(name, units, replications):
    draw, truth, bounds = SINGLE[name]
    values = draw(np.random.default_rng(units), (units, replications))
    found, wanted = mean_interval(values, bounds=bounds), least(units, bounds)
    if wanted is None:
        assert np.isnan([found.lower, found.upper]).all()
    else:
        assert covered(found, truth) >= wanted


def check_pairs(name, units, replications):
    draw, bounds = PAIRS[name]
    rng = np.random.default_rng(units)
    first, second = draw(rng, (1000, 500))
    truth = np.mean(first - second)
    found = difference_interval(*draw(rng, (units, replications)), bounds=bounds)
    wanted = least(units, bounds)
    if wanted is None:
        assert np.isnan([found.lower, found.upper]).all()
    else:
        assert covered(found, truth) >= wanted


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.parametrize("units", SIZES)
@pytest.mark.parametrize("name", SINGLE)
def test_means_are_covered_as_often_as_their_intervals_say(name, units):
    check_single(name, units, 2000)


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.parametrize("units", SIZES)
@pytest.mark.parametrize("name", PAIRS)
def test_differences_are_covered_as_often_as_their_intervals_say(name, units):
    check_pairs(name, units, 2000)


@pytest.mark.statistical
@pytest.mark.parametrize(
    "units", [n if n in (3, 11) else pytest.param(n, marks=pytest.mark.slow) for n in SIZES]
)
def test_the_same_for_the_hardest_cases_in_a_miniature(units):
    for name in ("lognormal", "few lost, pixels", "few lost, IoU", "0 or 1, .9"):
        check_single(name, units, 400)
    for name in ("IoU, 8% rescued", "0 or 1, 8% rescued"):
        check_pairs(name, units, 400)


@pytest.mark.statistical
@pytest.mark.parametrize("units", SIZES)
@pytest.mark.parametrize("name", ["normal", "lognormal", "few lost, pixels"])
def test_medians_are_covered_as_often_as_their_intervals_say(name, units):
    draw = SINGLE[name][0]
    rng = np.random.default_rng(units)
    truth = np.median(draw(rng, 1_000_000))
    found = median_interval(draw(rng, (units, 4000)))
    if units < 6:
        assert np.isnan([found.lower, found.upper]).all()
    else:
        assert covered(found, truth) >= 0.95 - 3 * math.sqrt(0.95 * 0.05 / 4000)


@pytest.mark.statistical
def test_students_interval_alone_would_not_do():
    """The simulation tells a method that covers from one that does not."""
    for name, units, most in (("few lost, IoU", 11, 0.75), ("lognormal", 11, 0.9)):
        draw, truth, _ = SINGLE[name]
        values = draw(np.random.default_rng(units), (1000, units))
        found = [student_interval(row) for row in values[:400]]
        ends = np.array([(each.lower, each.upper) for each in found]).T
        assert np.mean((ends[0] <= truth) & (truth <= ends[1])) < most


def test_units_that_all_succeed_give_the_interval_of_clopper_and_pearson():
    for units in (20, 3000):
        found = mean_interval(np.ones(units), bounds=UNIT)
        assert found.value == found.upper == 1
        assert 1 - found.lower == pytest.approx(1 - 0.025 ** (1 / units), rel=0.02)


@pytest.mark.parametrize(("gained", "lost"), [(6, 0), (9, 2), (12, 4), (5, 0), (3, 3)])
def test_a_difference_of_successes_excludes_0_where_mcnemars_exact_test_does(gained, lost):
    first = np.repeat([1.0, 0.0, 1.0], [gained, lost, 30 - gained - lost])
    second = np.repeat([0.0, 1.0, 1.0], [gained, lost, 30 - gained - lost])
    found = difference_interval(first, second, bounds=UNIT)
    p = stats.binomtest(gained, gained + lost).pvalue
    assert (found.lower > 0) == (p < 0.05)


def test_many_pairs_have_newcombes_interval():
    """Method 10 without its correction, from Clopper and Pearson's intervals of equal rates."""
    first = np.repeat([1.0, 1.0, 0.0], [26, 12, 12])
    second = np.repeat([1.0, 0.0, 1.0], [26, 12, 12])
    found = difference_interval(first, second, bounds=UNIT)
    interval = stats.binomtest(38, 50).proportion_ci()
    below, above = 0.76 - interval.low, interval.high - 0.76
    phi = np.corrcoef(first, second)[0, 1]
    reach = math.sqrt(below**2 - 2 * phi * below * above + above**2)
    assert (found.lower, found.upper) == pytest.approx((-reach, reach), rel=0.02)


def test_few_pairs_that_differ_have_the_bounded_interval_whatever_their_number():
    first = np.r_[np.ones(95), np.zeros(5)]
    found = difference_interval(np.ones(100), first, bounds=UNIT)
    wanted = mean_interval(1 - first, bounds=(-1.0, 1.0))
    assert found == wanted


def test_mean_and_error_by_hand():
    # Mean 14; deviations -3, -1, 4: squares 26, over U - 1 = 2: 13; error sqrt(13 / 3).
    found = mean_interval(np.array([11.0, 13.0, 18.0]), bounds=(0, 100))
    assert (found.value, found.standard_error) == pytest.approx((14, math.sqrt(13 / 3)))
    # Weights 1, 3: mean (1 * 2 + 3 * 6) / 4 = 5; w (x - m) = -3, 3: squares 18, times
    # U / (U - 1) = 2 over 4^2: 36 / 16.
    found = mean_interval(np.array([2.0, 6.0]), weights=np.array([1.0, 3.0]))
    assert (found.value, found.standard_error) == pytest.approx((5, 1.5))


def test_columns_are_those_of_their_own_units():
    """Missing values, weights of 0 and other axes change nothing."""
    values = np.random.default_rng(2).random((40, 3))
    values[5:, 1] = np.nan
    weights = np.ones((40, 3))
    weights[2:, 2] = 0
    together = mean_interval(values.T, weights.T, axis=1, bounds=UNIT)
    for column, units in enumerate((40, 5, 2)):
        alone = mean_interval(values[:units, column], bounds=UNIT)
        for ours, theirs in zip(together, alone, strict=True):
            assert ours[column] == pytest.approx(theirs, rel=0.1, nan_ok=True)
    assert np.isnan(together.lower[2])
    equal = mean_interval(values, 7.0, bounds=UNIT)
    np.testing.assert_allclose(equal, mean_interval(values, bounds=UNIT), rtol=1e-12)


def test_a_small_tail_is_beyond_a_larger_one():
    values = np.random.default_rng(3).random(20)
    ends = [mean_interval(values, level=x, bounds=UNIT).lower for x in (0.9, 0.99, 0.999, 0.99999)]
    assert ends == sorted(ends, reverse=True)
    assert len(set(ends)) == 4


def test_an_interval_costs_a_quarter_more_than_students_for_normal_values():
    values = np.random.default_rng(0).normal(size=(50, 200))
    found = mean_interval(values)
    reach = stats.t.ppf(0.975, 49) * found.standard_error
    assert 1.1 < np.median(found.upper - found.lower) / np.median(2 * reach) < 1.35


def test_few_units_have_at_least_students_interval():
    values = np.array([0.2, 0.5, 0.8])
    found, student = mean_interval(values, bounds=(-9.0, 9.0)), student_interval(values)
    assert found.upper >= student.upper
    assert mean_interval(values, bounds=UNIT).lower == 0  # Gaffke's alone ends above .03
    assert mean_interval(np.tile(values, 4), bounds=UNIT).lower > 0.3


def test_bounded_intervals_stay_within_their_bounds():
    values = np.random.default_rng(4).beta(0.2, 0.2, (4, 500))
    found = mean_interval(values, bounds=UNIT)
    assert (found.lower >= 0).all()
    assert (found.upper <= 1).all()
    assert (found.lower < found.value).all()


def test_equal_figures_have_no_width_whatever_rounding_does():
    found = mean_interval(np.full(30, 0.1) + 1e-9 * np.arange(30))
    assert not has_width(found.lower, found.upper)
    assert has_width(0.1, 0.1001)
    assert not has_width(math.nan, math.nan)


@pytest.mark.parametrize("interval", [mean_interval, median_interval])
def test_no_unit_has_no_value_and_one_no_interval(interval):
    assert math.isnan(interval([]).value)
    found = interval([3.0, math.nan])
    assert found.value == 3
    assert math.isnan(found.lower)
    assert math.isnan(found.upper)


def test_the_interval_of_a_median_by_hand():
    """Of nine values 2 P(at most one below) = .04, and 2 P(at most two) = .18."""
    found = median_interval([5, 1, 9, 2, 8, 3, 7, 4, 6])
    assert (found.value, found.lower, found.upper) == (5, 2, 8)
    found = median_interval(np.array([[1.0, 2, 3, np.nan]]), axis=1)
    assert found.value.tolist() == [2]
    assert median_interval([1.0, 2.0]).value == 1.5
