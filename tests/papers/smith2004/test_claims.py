"""Verdicts on the claims of smith2004, and their statistics."""

import numpy as np
from smith2004_outcomes import outcome_of

from jaxpf.papers import smith2004
from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, PREVIEW, SUPPORTED, judge_all
from jaxpf.papers.smith2004 import scenes, tables
from jaxpf.papers.smith2004.conditions import Measurement
from jaxpf.papers.smith2004.figures import figure_4


def verdicts(outcome):
    figures = smith2004.PAPER.quantities(Measurement(outcome, {}))
    return {each.claim.key: each.verdict for each in judge_all("smith2004", figures)}


def test_verdicts_follow_the_recovery_rates():
    clear = verdicts(
        outcome_of({"Non-PS": 0.02, "PS": 0.2, "DPS": 0.7, "SPS": 0.9}, runs=50, scenes_=25)
    )
    reverse = verdicts(
        outcome_of({"Non-PS": 0.7, "PS": 0.4, "DPS": 0.1, "SPS": 0.9}, runs=50, scenes_=25)
    )
    same = verdicts(outcome_of({"Non-PS": 0.3, "PS": 0.3, "DPS": 0.3, "SPS": 0.3}))
    for key in ("ps_recovers", "dps_recovers_each"):
        assert (clear[key], reverse[key], same[key]) == (SUPPORTED, NOT_SEEN, OPEN)


def test_few_scenes_are_a_preview():
    rates = {"Non-PS": 0.0, "PS": 0.5, "DPS": 1.0, "SPS": 1.0}
    for count in (1, 9):
        assert set(verdicts(outcome_of(rates, scenes_=count)).values()) == {PREVIEW}


def test_orders_that_differ_are_told_from_luck():
    names = [name for name in scenes.all_orderings() if name.startswith("PS ")]
    base = {"Non-PS": 0.02, "DPS": 0.4, "SPS": 0.7}
    alike = outcome_of({**base, **dict.fromkeys(names, 0.3)}, runs=2)
    # The worst of seven equal orders looks far below the best, on the scenes that chose them.
    rates = alike.recovered[:, alike.orders(), 0].mean(axis=(0, 2))
    assert rates.max() - rates.min() > 0.1
    assert verdicts(alike)["orders"] != SUPPORTED
    far = {**base, **dict(zip(names, np.linspace(0.02, 0.8, 7), strict=True))}
    assert verdicts(outcome_of(far, scenes_=80))["orders"] == SUPPORTED


def test_worst_and_best_are_those_of_the_recovery_rate():
    names = [name for name in scenes.all_orderings() if name.startswith("PS ")]
    rates = dict(zip(names, [0.5, 0.5, 0.0, 0.5, 1.0, 0.5, 0.5], strict=True))
    outcome = outcome_of({"Non-PS": 0.0, "DPS": 0.4, "SPS": 0.7, **rates})
    found = {table.name: table for table in tables.tables(Measurement(outcome, {}))}
    recovery = found["table_2_recovery"]
    cells = dict(zip(recovery.columns[1:], recovery.rows[0][1], strict=True))
    assert cells["PS worst"].measured.value == 0
    assert cells["PS best"].measured.value == 100
    assert cells["PS worst"].published == 10
    assert cells["PS best"].published is None
    assert recovery.rows[1][1][3].published == 38
    assert cells["SPS"].published is None


def test_uniqueness_is_read_by_stage():
    """Object (shift + stage) stands at that stage of the order that begins with ``shift``."""
    outcome = outcome_of({"Non-PS": 0, "PS": 0.1, "DPS": 0.2, "SPS": 0.3})
    for shift, place in enumerate(outcome.orders()):
        for stage, partition in enumerate(scenes.shifted(shift)):
            outcome.uniqueness[:, place, 0, partition] = 0.01 * (stage + 1)
    found = {table.name: table for table in tables.tables(Measurement(outcome, {}))}
    values = [cells[0].measured.value for _, cells in found["uniqueness"].rows]
    np.testing.assert_allclose(values, np.arange(1, 8))


def test_figures_are_drawn():
    outcome = outcome_of({"Non-PS": 0.02, "PS": 0.2, "DPS": 0.4, "SPS": 0.7})
    assert len(figure_4(outcome).axes) == 15
