"""Verdicts on the claims of smith2004, and their statistics."""

import numpy as np
from judged import verdicts
from smith2004_outcomes import outcome_of

from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, PREVIEW, SUPPORTED
from jaxpf.papers.smith2004 import PAPER, scenes
from jaxpf.papers.smith2004.study import best_and_worst, figure_4, study_of

RATES = {"Non-PS": 0.0, "PS": 0.3, "DPS": 0.4, "SPS": 0.7}
ORDERS = [name for name in scenes.all_orderings() if name.startswith("PS ")]


def tables(outcome, conditions=None):
    return {table.name: table for table in PAPER.tables(study_of(outcome, conditions or {}))}


def test_verdicts_follow_the_recovery_rates():
    def judged(*rates, **made):
        outcome = outcome_of(dict(zip(RATES, rates, strict=True)), **made)
        return verdicts(PAPER, study_of(outcome, {}))

    clear = judged(0.02, 0.2, 0.7, 0.9, runs=50, scenes_=25)
    reverse = judged(0.7, 0.4, 0.1, 0.9, runs=50, scenes_=25)
    same = judged(0.3, 0.3, 0.3, 0.3, runs=4)
    for key in ("ps_recovers", "dps_recovers_each"):
        assert (clear[key], reverse[key], same[key]) == (SUPPORTED, NOT_SEEN, OPEN)


def test_few_scenes_are_a_preview():
    for count in (1, 9):
        found = verdicts(PAPER, study_of(outcome_of(RATES, scenes_=count), {}))
        assert set(found.values()) == {PREVIEW}


def test_orders_that_differ_are_told_from_luck():
    alike = outcome_of(RATES, runs=2)
    # The worst of seven equal orders looks far below the best, on the scenes that chose them.
    rates = alike.recovered[:, alike.of("PS"), 0].mean(axis=(0, 2))
    assert rates.max() - rates.min() > 0.1
    assert verdicts(PAPER, study_of(alike, {}))["orders"] != SUPPORTED
    far = {**RATES, **dict(zip(ORDERS, np.linspace(0.02, 0.8, 7), strict=True))}
    assert verdicts(PAPER, study_of(outcome_of(far, scenes_=80), {}))["orders"] == SUPPORTED


def test_worst_and_best_are_those_of_the_recovery_rate():
    rates = dict(zip(ORDERS, [0.5, 0.5, 0.0, 0.5, 1.0, 0.5, 0.5], strict=True))
    recovery = tables(outcome_of({**RATES, **rates}))["table_2_recovery"]
    cells = dict(zip(recovery.columns[1:], recovery.rows[0][1], strict=True))
    assert cells["PS worst"].measured.value == 0
    assert cells["PS best"].measured.value == 100
    assert cells["PS worst"].published == 10
    assert cells["PS best"].published is None
    assert recovery.rows[1][1][3].published == 38
    assert cells["SPS"].published is None


def test_uniqueness_is_read_by_stage():
    """Object (shift + stage) stands at that stage of the order that begins with ``shift``."""
    outcome = outcome_of(RATES)
    for shift, place in enumerate(outcome.of("PS")):
        for stage, partition in enumerate(scenes.shifted(shift)):
            outcome.uniqueness[:, place, 0, partition] = 0.01 * (stage + 1)
    values = [cells[0].measured.value for _, cells in tables(outcome)["uniqueness"].rows]
    np.testing.assert_allclose(values, np.arange(1, 8))


def test_orders_are_told_by_the_stage_of_object_1():
    rates = dict.fromkeys([*ORDERS, *RATES], 0.0) | {"PS 2,3,4,5,6,7,1": 1.0}
    outcome = outcome_of(rates)
    ((label, cells),) = tables(outcome, {"N = 300, as here": outcome})["conditions"].rows
    assert label == "N = 300, as here"
    values = [cell.measured.value for cell in cells]
    np.testing.assert_allclose(values, [100 / 7, 100, -100 / 7, 0, 0, 100])


def test_gaps_are_free_of_the_luck_of_selection():
    rng = np.random.default_rng(0)
    alike = np.subtract(*best_and_worst(rng.normal(size=(4000, 7, 1))))[:, 0]
    assert alike.shape == (2000,)
    assert abs(alike.mean()) < 3.3 * np.sqrt(2 / 2000)
    apart = np.subtract(*best_and_worst(np.arange(7) + rng.normal(size=(200, 7))))
    assert abs(apart.mean() - 6) < 3.3 * np.sqrt(2 / 100)


def test_figures_are_drawn():
    assert len(figure_4(outcome_of(RATES)).axes) == 15
