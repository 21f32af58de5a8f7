import math
from statistics import NormalDist

import numpy as np
import pytest

from jaxpf.papers.judging.claims import (
    CANNOT_RESOLVE,
    CONTRADICTS,
    EQUAL,
    SUPPORTS,
    Quantity,
    at_look,
    cluster_interval,
    exact,
    growth,
    judged,
    level_of,
    newcombe,
    shown,
    student,
    told,
    verdict,
    wilson,
)


def fixed(value, reach, **claimed):
    """A quantity whose interval is ``value +- reach`` at 95 %, wider at higher levels."""

    def interval(level):
        wider = reach * (1 if level <= 0.95 else 1.5)
        return value - wider, value + wider

    return Quantity("it", value, interval, **claimed)


def test_a_claim_is_supported_where_the_whole_interval_lies_in_its_range():
    assert verdict([fixed(10, 5, at_least=0)]) == SUPPORTS
    assert verdict([fixed(-10, 5, at_most=0)]) == SUPPORTS
    assert verdict([fixed(0, 1, at_least=-2, at_most=2)]) == SUPPORTS


def test_a_claim_is_contradicted_where_the_whole_interval_lies_outside():
    assert verdict([fixed(-10, 5, at_least=0)]) == CONTRADICTS
    assert verdict([fixed(5, 1, at_least=-2, at_most=2)]) == CONTRADICTS


def test_an_interval_that_straddles_the_boundary_resolves_nothing():
    assert verdict([fixed(3, 5, at_least=0)]) == CANNOT_RESOLVE
    assert verdict([fixed(-3, 5, at_least=0)]) == CANNOT_RESOLVE
    assert verdict([]) == CANNOT_RESOLVE
    assert verdict([fixed(math.nan, math.nan, at_least=0)]) == CANNOT_RESOLVE


def test_all_parts_must_support_and_one_is_enough_to_contradict():
    good, open_, bad = (fixed(value, 5, at_least=0) for value in (10, 1, -20))
    assert verdict([good, good]) == SUPPORTS
    assert verdict([good, open_]) == CANNOT_RESOLVE
    assert verdict([good, bad]) == CONTRADICTS


def test_the_more_parts_the_more_it_takes_to_contradict():
    # Outside at 95 %, not at the corrected level of two parts.
    slightly = fixed(-6, 5, at_least=0)
    assert verdict([slightly]) == CONTRADICTS
    assert verdict([fixed(10, 5, at_least=0), slightly]) == CANNOT_RESOLVE


def test_near_an_end_within_the_margin_is_equal():
    assert verdict([fixed(0.5, 2, at_least=0, margin=3)]) == EQUAL
    assert verdict([fixed(-0.5, 2, at_least=0, margin=3)]) == EQUAL
    assert verdict([fixed(10, 2, at_least=0), fixed(0, 2, at_least=0, margin=3)]) == EQUAL
    assert verdict([fixed(0, 2, at_least=0), fixed(0, 2, at_least=0, margin=3)]) == CANNOT_RESOLVE
    assert verdict([fixed(2, 2.5, at_least=0, margin=3)]) == CANNOT_RESOLVE
    assert verdict([fixed(4, 2, at_least=0, margin=3)]) == SUPPORTS
    # Outside of the range, and not clearly outside of the margin.
    assert verdict([fixed(-4, 2, at_least=0, margin=3)]) == CANNOT_RESOLVE
    assert verdict([fixed(-6, 2, at_least=0, margin=3)]) == CONTRADICTS
    # However narrow the interval becomes.
    assert verdict([fixed(-1, 0.5, at_least=0, margin=3)]) == EQUAL


def test_agreement_without_a_width_is_no_certainty():
    assert verdict([fixed(10, 0, at_least=0)]) == CANNOT_RESOLVE
    assert verdict([fixed(-10, 0, at_least=0)]) == CANNOT_RESOLVE
    assert verdict([exact(10, at_least=0)]) == SUPPORTS
    assert verdict([exact(-10, at_least=0)]) == CONTRADICTS


@pytest.mark.parametrize(("successes", "trials"), [(8, 10), (8, 8), (5, 10)])
def test_so_many_runs_as_are_told_resolve_it(successes, trials):
    """A rate, claimed to be at least 70 %, judged again on so many times as many trials."""

    def rate(times):
        value = 100 * successes / trials
        return Quantity("", value, wilson(times * successes, times * trials), at_least=70)

    assert verdict([rate(1)]) == CANNOT_RESOLVE
    needed = growth([rate(1)])
    assert verdict([rate(1.02 * needed)]) != CANNOT_RESOLVE
    assert verdict([rate(0.98 * needed)]) == CANNOT_RESOLVE
    claim = told(judged("rate", "", "", rate(1)), trials)
    assert f"about {math.ceil(needed * trials)} runs would resolve it" in claim.measured


def test_so_many_runs_as_are_told_make_it_equal():
    def difference(times):
        def interval(level):
            reach = 8 * NormalDist().inv_cdf(0.5 + level / 2) / math.sqrt(times)
            return 1 - reach, 1 + reach

        return Quantity("", 1.0, interval, at_least=0, margin=3)

    # Above 0 it clearly is once the reach is 1; with less, at 2, it lies within 3 of it.
    needed = growth([difference(1)])
    assert needed == pytest.approx((1.96 * 8 / 2) ** 2, rel=0.01)
    assert verdict([difference(1.02 * needed)]) == EQUAL
    assert verdict([difference(0.98 * needed)]) == CANNOT_RESOLVE


LOOKS = 7


def at_looks(effect, **claimed):
    """The verdicts that 2000 claims on means end with, looked at on 10, 20, ... 640 values."""
    rng, found = np.random.default_rng(0), []
    for _ in range(2000):
        drawn = rng.normal(effect, size=10 * 2 ** (LOOKS - 1))
        for look in range(1, LOOKS + 1):
            seen = drawn[: 10 * 2 ** (look - 1)]
            part = Quantity("", seen.mean(), student(seen), **claimed)
            if (its := verdict([part], level_of(look))) != CANNOT_RESOLVE:
                break
        found.append(its)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "wrong"),
    [
        (0.5, (CONTRADICTS, EQUAL)),
        (-0.5, (SUPPORTS, EQUAL)),
        (0.0, (SUPPORTS, CONTRADICTS)),  # at the end of the range
        (0.3, (CONTRADICTS, EQUAL)),  # on the margin, which is not within it
        (-0.3, (SUPPORTS, EQUAL, CONTRADICTS)),  # no runs tell on which side of the margin it lies
    ],
)
def test_looking_again_and_again_misleads_as_seldom_as_looking_once(effect, wrong):
    found = at_looks(effect, at_least=0, margin=0.3)
    assert np.isin(found, wrong).mean() <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / len(found))
    assert len(wrong) == 3 or (found != CANNOT_RESOLVE).mean() > 0.9


def test_looks_share_the_level_among_them():
    assert sum(1 - level_of(look) for look in range(1, 10_000)) == pytest.approx(0.05, rel=1e-3)


def test_a_later_look_judges_by_wider_intervals():
    values = np.random.default_rng(0).normal(0.7, size=10)
    part = Quantity("", values.mean(), student(values), at_least=0)
    claim = judged("a > b", "", "", part, digits=2)
    assert claim.verdict == SUPPORTS
    noted = claim._replace(measured=f"{claim.measured}; and a word")
    later = at_look(noted, 30)
    assert later.verdict == CANNOT_RESOLVE
    assert later.growth > 1
    assert later.measured == f"{shown([part], 2, level_of(30))}; and a word"
    assert later.measured != noted.measured


def test_what_no_number_of_runs_resolves_is_told():
    assert "no number of runs" in told(judged("", "", "", fixed(0, 1, at_least=0)), 5).measured
    assert "too few runs" in told(judged("", "", "", fixed(5, 0, at_least=0)), 5).measured


def test_a_judged_claim_shows_its_figures():
    claim = judged("a > b", "table 1", "3, 4", fixed(10, 5, at_least=0))
    assert claim[:5] == ("a > b", "table 1", "3, 4", "it: 10 [5, 15]", SUPPORTS)
    assert shown([fixed(1, 0.25)._replace(what="")], digits=2) == "1.00 [0.75, 1.25]"


def test_students_interval_is_the_textbooks():
    # Five values with mean 3 and standard deviation sqrt(2.5); t(.975, 4) = 2.776.
    low, high = student(np.array([1.0, 2, 3, 4, 5]))(0.95)
    reach = 2.7764 * math.sqrt(2.5 / 5)
    np.testing.assert_allclose([low, high], [3 - reach, 3 + reach], rtol=1e-4)
    assert all(map(math.isnan, student(np.array([1.0]))(0.95)))
    assert student(np.array([1.0, 2, 3, 4, 5, np.nan]))(0.95) == (low, high)


def test_newcombes_interval_is_the_published_one():
    # Newcombe 1998, table II, example (a): 56/70 against 48/80, method 10: .0524 to .3339.
    low, high = newcombe((56, 48), (70, 80))(0.95)
    np.testing.assert_allclose([low, high], [5.24, 33.39], atol=0.01)
    # Example (e): 5/56 against 0/29: -.0381 to .1926.
    np.testing.assert_allclose(newcombe((5, 0), (56, 29))(0.95), [-3.81, 19.26], atol=0.01)


def test_clusters_that_agree_with_themselves_widen_the_interval():
    alike = np.array([0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4])
    divided = np.array([1.0, 0, 1, 0, 1, 0, 0.2, 0])
    assert np.mean(alike) == pytest.approx(np.mean(divided))
    low, high = cluster_interval(alike, 5)(0.95)
    wide_low, wide_high = cluster_interval(divided, 5)(0.95)
    assert wide_low < low - 5
    assert wide_high > high + 5
    # Never narrower than if all trials were independent.
    independent = wilson(16, 40)(0.95)
    assert low <= independent[0]
    assert high >= independent[1]


def test_where_nothing_succeeded_each_cluster_counts_as_one_trial():
    assert cluster_interval(np.zeros(10), 5)(0.95) == wilson(0, 10)(0.95)


@pytest.mark.statistical
def test_cluster_intervals_cover_the_rate():
    """Scenes of different difficulty: the interval holds the population's rate often enough."""
    rng = np.random.default_rng(0)
    repeats, covered = 400, 0
    for _ in range(repeats):
        scenes = rng.beta(0.6, 0.9, size=10)
        rates = rng.binomial(5, scenes) / 5
        low, high = cluster_interval(rates, 5)(0.95)
        covered += low <= 100 * 0.4 <= high
    # 95 %, less three standard errors of 400 repeats.
    assert covered / repeats > 0.95 - 3 * math.sqrt(0.95 * 0.05 / repeats)


def test_a_chosen_figure_is_resolved_by_more_runs():
    """The correction for the choice widens an interval, and does not keep it from shrinking."""
    interval = newcombe((25, 25), (50, 50))
    part = Quantity("", 0.0, interval, at_least=0, margin=5.0, chosen_among=20)
    assert part.at(0.95) == interval(1 - 0.05 / 20)
    times = growth([part])
    assert 20 < times < 60  # half the interval is 27 points wide: about (27 / 5)^2
    runs = round(50 * times * 1.1)
    enough = newcombe((runs / 2, runs / 2), (runs, runs))
    assert verdict([part._replace(interval=enough)]) == EQUAL
