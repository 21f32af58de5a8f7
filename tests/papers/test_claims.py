"""The rule by which claims are judged."""

import math

import numpy as np
import pytest

from jaxpf.measures import difference_interval, mean_interval
from jaxpf.papers.judging.claims import (
    CONTRADICTED,
    EQUAL,
    NOT_SEEN,
    OPEN,
    PAPERS_OWN,
    PREVIEW,
    SUPPORTED,
    WEAKER,
    Claim,
    growth,
    judge,
)
from jaxpf.papers.judging.estimates import Quantity, computed, gain_of, mean_of, ratio_of, share_of


def claim(at_least=-math.inf, at_most=math.inf, margin=0.0, digits=0, settings=PAPERS_OWN):
    words = "key", "paper", "It holds", "10", "It holds.", "3"
    return Claim(*words, at_least, at_most, margin, digits, "scenes", settings)


def fixed(value, reach, count=20, what=""):
    """A figure with the interval ``value +- reach`` at 95%, and a wider one at higher levels."""

    def interval(level):
        wider = reach * (1 if level <= 0.95 else 1.5)
        return value - wider, value + wider

    return Quantity(value, interval, count, what)


def verdict(*figures, **claimed):
    return judge(claim(**claimed), figures).verdict


NAN = fixed(math.nan, math.nan)
LOOSE = mean_of(np.full(30, -0.08) + 1e-9 * np.arange(30))
GOOD, OPENED, BAD = (fixed(value, 5) for value in (10, 1, -20))
SLIGHTLY = fixed(-6, 5)  # outside at 95%, but not at the level of two figures


@pytest.mark.parametrize(
    ("wanted", "figures", "claimed"),
    [
        # The whole interval lies in the range.
        (SUPPORTED, [fixed(10, 5)], {"at_least": 0}),
        (SUPPORTED, [fixed(-10, 5)], {"at_most": 0}),
        (SUPPORTED, [fixed(0, 1)], {"at_least": -2, "at_most": 2}),
        # It lies outside by more than the margin.
        (CONTRADICTED, [fixed(-10, 5)], {"at_least": 0}),
        (CONTRADICTED, [fixed(5, 1)], {"at_least": -2, "at_most": 2}),
        (CONTRADICTED, [fixed(-10, 5)], {"at_least": 0, "margin": 4}),
        (OPEN, [fixed(-10, 5)], {"at_least": 0, "margin": 6}),
        # Settings of ours contradict nothing.
        (NOT_SEEN, [fixed(-10, 5)], {"at_least": 0, "settings": ""}),
        (SUPPORTED, [fixed(10, 5)], {"at_least": 0, "settings": ""}),
        # Within the margin.
        (WEAKER, [fixed(66, 14)], {"at_least": 90, "margin": 40}),
        (WEAKER, [fixed(66, 14), fixed(95, 2)], {"at_least": 90, "margin": 40}),
        (OPEN, [fixed(85, 14)], {"at_least": 90, "margin": 40}),
        (OPEN, [fixed(66, 14)], {"at_least": 90, "margin": 20}),
        ("equal within 1.25", [fixed(-0.2, 1)], {"at_least": 0, "margin": 1.25}),
        (OPEN, [fixed(0.2, 1)], {"at_least": 0, "margin": 1.25}),  # it may be above
        ("equal within 3", [fixed(-2, 0.5)], {"at_least": -1, "at_most": 1, "margin": 2}),
        ("equal within 3", [fixed(-2, 0.5), fixed(0, 0.5)],
         {"at_least": -1, "at_most": 1, "margin": 2}),
        # Across the end of the range.
        *((OPEN, [figure], {"at_least": 0}) for figure in (fixed(3, 5), fixed(-3, 5), NAN)),
        # Every figure must support, and one is enough to contradict; more make that harder.
        (SUPPORTED, [GOOD, GOOD], {"at_least": 0}),
        (OPEN, [GOOD, OPENED], {"at_least": 0}),
        (CONTRADICTED, [GOOD, BAD], {"at_least": 0}),
        (CONTRADICTED, [SLIGHTLY], {"at_least": 0}),
        (OPEN, [GOOD, SLIGHTLY], {"at_least": 0}),
        # An interval without width resolves nothing unless it is computed.
        *((OPEN, [LOOSE], {"at_least": least}) for least in (-0.0801, -0.02)),
        (SUPPORTED, [computed(10)], {"at_least": 0}),
        (CONTRADICTED, [computed(-10)], {"at_least": 0}),
        # Few scenes are a preview.
        *((PREVIEW, [fixed(value, 5, count=count)], {"at_least": 0, "settings": settings})
          for value, count, settings in ((10, 9, PAPERS_OWN), (-10, 2, PAPERS_OWN), (-10, 9, ""))),
        (SUPPORTED, [fixed(10, 5, count=10)], {"at_least": 0}),
    ],
)  # fmt: skip
def test_verdicts_follow_from_intervals(wanted, figures, claimed):
    assert verdict(*figures, **claimed) == wanted


def test_an_open_claim_says_how_many_scenes_would_resolve_it():
    judged = judge(claim(at_least=0), [fixed(5, 10)])
    assert growth(claim(at_least=0), [fixed(5, 10)]) == pytest.approx(4)
    assert judged.remark == "about 80 scenes would resolve it"
    assert judge(claim(at_least=0), [fixed(0, 1)]).remark == "more scenes would not resolve it"
    assert judge(claim(at_least=0), [fixed(5, 0)]).remark == "too few scenes to say more"
    assert judge(claim(at_least=0, margin=3), [fixed(-0.5, 2)]).remark == ""


@pytest.mark.parametrize(
    ("value", "reach", "at_least", "margin", "resolved"),
    [(62, 14.5, 90, 40, WEAKER), (-4, 11, 0, 5, f"{EQUAL} 5")],
)
def test_a_figure_within_the_margin_is_weaker_with_more_scenes(
    value, reach, at_least, margin, resolved
):
    claimed = {"at_least": at_least, "margin": margin}
    assert verdict(fixed(value, reach), **claimed) == OPEN
    root = growth(claim(**claimed), [fixed(value, reach)]) ** 0.5
    assert verdict(fixed(value, 0.99 * reach / root), **claimed) == resolved
    assert verdict(fixed(value, 1.01 * reach / root), **claimed) == OPEN


def test_that_many_scenes_do_resolve_it():
    """A mean of normal figures, judged again on 1.5 times as many scenes as it says."""
    rng = np.random.default_rng(0)
    few = mean_of(rng.normal(0.4, 1, 25))
    times = growth(claim(at_least=0), [few])
    assert times > 1
    steps = np.linspace(-1, 1, math.ceil(1.5 * 25 * times))
    many = mean_of(few.value + steps / steps.std())
    assert verdict(many, at_least=0) == SUPPORTED


def test_a_judged_claim_shows_its_figures_and_their_span():
    judged = judge(claim(at_least=0), [fixed(10, 5, what="20"), fixed(20, 5, 30, "30")])
    assert judged.ours == "10 to 20 [5, 25]"
    assert judged.shown == "20: 10 [5, 15]; 30: 20 [15, 25]"
    assert judged.units == "20 scenes"
    shown = judge(claim(digits=2), [computed(0.5)])
    assert (shown.ours, shown.shown, shown.units) == ("0.50", "0.50", "computed")
    few = judge(claim(at_least=0), [mean_of([1.0, 2.0]), mean_of([3.0, 5.0], what="x")])
    assert (few.verdict, few.ours, few.shown) == (PREVIEW, "2 to 4", "2; x: 4")


def test_unbounded_means_of_few_scenes_are_open():
    values = 1 + 0.1 * np.random.default_rng(0).normal(size=25)
    assert verdict(mean_of(values), at_least=0) == SUPPORTED
    few = judge(claim(at_least=0), [mean_of(values[:24])])
    assert (few.verdict, few.remark) == (OPEN, "too few scenes to say more")


def test_figures_are_those_of_the_measures_intervals():
    rng = np.random.default_rng(0)
    values, rates = rng.exponential(size=30), rng.binomial(4, 0.7, (2, 30)) / 4
    found = mean_interval(values)
    assert mean_of([*values, math.nan]).measured() == (found.value, found.lower, found.upper)
    for figure, found in (
        (share_of(rates[0]), mean_interval(rates[0], bounds=(0, 1))),
        (share_of(*rates), difference_interval(*rates, bounds=(0, 1))),
    ):
        np.testing.assert_allclose(figure.measured(), 100 * np.array(found)[[0, 2, 3]])
    assert share_of(np.ones(20)).measured().high == 100


def test_ratios_and_gains_are_geometric_means_scene_by_scene():
    few = ratio_of([1.0, 4.0, 0.0, 2.0], [2.0, 2.0, 1.0, math.nan])
    assert (few.value, few.units) == (pytest.approx(1), 2)
    assert math.isnan(few.measured().low)
    low, high = ratio_of([1.0, 4.0] * 15, [2.0, 2.0] * 15).interval(0.95)
    assert low == pytest.approx(1 / high, rel=0.05)
    found = gain_of([15.0, 60.0] * 15, [20.0, 60.0] * 15)
    np.testing.assert_allclose(found.value, 100 * (1 - np.sqrt(0.75)))
    low, high = found.interval(0.9)
    assert low < found.value < high
