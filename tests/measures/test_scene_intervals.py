"""Intervals over scenes are wrong on either side as seldom as they say, whatever the data."""

import math

import numpy as np
import pytest
from scipy.special import betaincinv, ndtr

from jaxpf import InputError
from jaxpf.measures import has_width, paired_rates_interval, scene_interval, student_interval

REPEATS, TRIALS = 4000, 30
#: At most 2.5 % wrong on either side, and three standard errors of the simulation.
MOST_WRONG = 0.025 + 3 * math.sqrt(0.025 * 0.975 / REPEATS)


def rates(rng, mean, scenes, uniform=None):
    """Rates ``[REPEATS, scenes]`` of 30 trials that a scene's difficulty correlates."""
    uniform = rng.random((REPEATS, scenes)) if uniform is None else uniform
    return rng.binomial(TRIALS, betaincinv(mean / 2, (1 - mean) / 2, uniform)) / TRIALS


def with_lost_scenes(rng, shape):
    return np.where(rng.random(shape) < 0.1, 1.0, 0.1 + 0.02 * rng.normal(size=shape))


DRAWN = {
    "normal": (lambda rng, shape: rng.normal(size=shape), 0.0, None),
    "exponential": (lambda rng, shape: rng.exponential(size=shape), 1.0, None),
    "lognormal": (lambda rng, shape: rng.lognormal(size=shape), math.exp(0.5), None),
    "a tenth lost": (with_lost_scenes, 0.19, (0.0, 1.0)),
    "rate .9": (lambda rng, shape: rates(rng, 0.9, shape[1]), 0.9, (0.0, 1.0)),
    "rate .99": (lambda rng, shape: rates(rng, 0.99, shape[1]), 0.99, (0.0, 1.0)),
}


def wrong(intervals, truth):
    """Shares of the intervals that lie above and below the truth."""
    low, high = np.array([(each.lower, each.upper) for each in intervals]).T
    return (low > truth).mean(), (high < truth).mean()


@pytest.mark.statistical
@pytest.mark.parametrize("scenes", [25, 50])
@pytest.mark.parametrize("name", DRAWN)
def test_intervals_of_means_are_as_seldom_wrong_as_they_say(name, scenes):
    draw, truth, bounds = DRAWN[name]
    values = draw(np.random.default_rng(scenes), (REPEATS, scenes))
    assert max(wrong([scene_interval(row, bounds=bounds) for row in values], truth)) <= MOST_WRONG


@pytest.mark.statistical
@pytest.mark.parametrize("scenes", [25, 50])
@pytest.mark.parametrize(("one", "other", "alike"), [(0.9, 0.6, 0.8), (0.5, 0.5, 0.9)])
def test_intervals_of_paired_rates_are_as_seldom_wrong_as_they_say(one, other, alike, scenes):
    rng = np.random.default_rng(scenes)
    scene, own = rng.normal(size=(REPEATS, scenes)), rng.normal(size=(2, REPEATS, scenes))
    uniform = ndtr(math.sqrt(alike) * scene + math.sqrt(1 - alike) * own)
    first, second = (
        rates(rng, *each) for each in ((one, scenes, uniform[0]), (other, scenes, uniform[1]))
    )
    found = [paired_rates_interval(*pair) for pair in zip(first, second, strict=True)]
    assert max(wrong(found, one - other)) <= MOST_WRONG


@pytest.mark.statistical
def test_students_interval_would_be_wrong_far_more_often():
    """The simulation tells a method that does not hold its level from one that does."""
    values = np.random.default_rng(25).lognormal(size=(REPEATS, 25))
    assert max(wrong(map(student_interval, values), math.exp(0.5))) > 2 * MOST_WRONG


def test_scenes_that_all_succeed_give_the_interval_of_clopper_and_pearson():
    low = 0.025 ** (1 / 20)
    found = scene_interval(np.ones(20), bounds=(0.0, 1.0))
    assert found.value == found.upper == 1
    assert found.lower == pytest.approx(low, abs=0.01)


def test_an_interval_costs_a_quarter_more_than_students_for_normal_values():
    values = np.random.default_rng(0).normal(size=(200, 50))
    widths = [
        np.median([found.upper - found.lower for found in map(method, values)])
        for method in (scene_interval, student_interval)
    ]
    assert 1.1 < widths[0] / widths[1] < 1.35


def test_equal_figures_have_no_width_whatever_rounding_does():
    found = scene_interval(np.full(10, 0.1) + 1e-9 * np.arange(10))
    assert not has_width(found.lower, found.upper)
    assert has_width(0.1, 0.1001)
    assert not has_width(math.nan, math.nan)


def test_fewer_than_two_scenes_have_no_interval():
    found = scene_interval([3.0, math.nan])
    assert found.value == 3
    assert math.isnan(found.lower)
    assert math.isnan(found.upper)
    assert math.isnan(scene_interval([]).value)


def test_the_order_of_scenes_does_not_matter_much_and_repeats_are_equal():
    values = np.random.default_rng(1).exponential(size=30)
    assert scene_interval(values) == scene_interval(values)
    assert scene_interval(values).upper == pytest.approx(
        scene_interval(values[::-1]).upper, rel=0.03
    )


@pytest.mark.parametrize("level", [-1, 0, 1, 95, math.nan, "x", None])
def test_a_level_that_is_no_probability_is_refused(level):
    for interval in (student_interval, scene_interval):
        with pytest.raises(InputError, match=f"level={level!r} must be above 0 and below 1"):
            interval([1.0, 2.0, 3.0], level)
    with pytest.raises(InputError, match=f"level={level!r} must be above 0 and below 1"):
        paired_rates_interval([0.5, 1.0], [0.2, 0.3], level)
