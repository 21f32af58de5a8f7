"""Verdicts on the claims of smith2004, and their statistics."""

import numpy as np
import pytest
from smith2004_outcomes import outcome_of

from jaxpf.papers.judging.claims import CANNOT_RESOLVE, CONTRADICTS, SUPPORTS
from jaxpf.papers.smith2004 import scenes, tables
from jaxpf.papers.smith2004.claims import scene_claims
from jaxpf.papers.smith2004.figures import figure_4, figure_recovery
from jaxpf.papers.smith2004.orders import order_p_value


def claim_on(claims, words):
    (claim,) = [claim for claim in claims if words in claim.statement]
    return claim


def test_verdicts_follow_the_recovery_rates():
    clear = {"Non-PS": 0.02, "PS": 0.2, "DPS": 0.7, "SPS": 0.9}
    claims = scene_claims(outcome_of(clear, runs=50))
    assert claim_on(claims, "PS, on average").verdict == SUPPORTS
    assert claim_on(claims, "at every sharpness").verdict == SUPPORTS
    reverse = {"Non-PS": 0.7, "PS": 0.4, "DPS": 0.1, "SPS": 0.9}
    claims = scene_claims(outcome_of(reverse, runs=50))
    assert claim_on(claims, "PS, on average").verdict == CONTRADICTS
    assert claim_on(claims, "at every sharpness").verdict == CONTRADICTS
    same = {"Non-PS": 0.3, "PS": 0.3, "DPS": 0.3, "SPS": 0.3}
    claims = scene_claims(outcome_of(same))
    assert claim_on(claims, "PS, on average").verdict == CANNOT_RESOLVE
    assert claim_on(claims, "at every sharpness").verdict == CANNOT_RESOLVE


def test_one_scene_resolves_nothing():
    rates = {"Non-PS": 0.0, "PS": 0.5, "DPS": 1.0, "SPS": 1.0}
    claims = scene_claims(outcome_of(rates, scenes_=1))
    assert {claim.verdict for claim in claims} == {CANNOT_RESOLVE}


def test_orders_that_differ_are_told_from_luck():
    names = [name for name in scenes.all_orderings() if name.startswith("PS ")]
    base = {"Non-PS": 0.02, "DPS": 0.4, "SPS": 0.7}
    alike = outcome_of({**base, **dict.fromkeys(names, 0.3)})
    differ = outcome_of({**base, **dict(zip(names, np.linspace(0.05, 0.6, 7), strict=True))})
    orders = alike.orders()
    # The worst of seven equal orders looks far below the best ...
    rates = alike.recovered[:, orders, 0].mean(axis=(0, 2))
    assert rates.max() - rates.min() > 0.1
    # ... but no more so than by chance, and not on scenes that had no say in the choice.
    assert order_p_value(alike.recovered[:, orders, 0]) > 0.05
    assert order_p_value(differ.recovered[:, orders, 0]) < 0.01
    assert claim_on(scene_claims(alike), "worst order").verdict != SUPPORTS
    far = {**base, **dict(zip(names, np.linspace(0.02, 0.8, 7), strict=True))}
    far = outcome_of(far, scenes_=40)
    assert claim_on(scene_claims(far), "worst order").verdict == SUPPORTS


@pytest.mark.statistical
def test_p_values_of_equal_orders_are_uniform():
    rng = np.random.default_rng(1)
    values = [order_p_value(rng.uniform(size=(6, 7, 5)) < 0.3) for _ in range(60)]
    assert 0.5 - 4 * np.sqrt(1 / 12 / 60) < np.mean(values) < 0.5 + 4 * np.sqrt(1 / 12 / 60)


def test_worst_and_best_are_those_of_the_recovery_rate():
    names = [name for name in scenes.all_orderings() if name.startswith("PS ")]
    rates = dict(zip(names, [0.5, 0.5, 0.0, 0.5, 1.0, 0.5, 0.5], strict=True))
    outcome = outcome_of({"Non-PS": 0.0, "DPS": 0.4, "SPS": 0.7, **rates})
    recovery, *_ = tables.table_2(outcome)
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
    table = tables.uniqueness_table(outcome)
    values = [cell.measured.value for cell in table.rows[0][1]]
    np.testing.assert_allclose(values, np.arange(1, 8))


def test_figures_are_drawn():
    outcome = outcome_of({"Non-PS": 0.02, "PS": 0.2, "DPS": 0.4, "SPS": 0.7})
    assert len(figure_4(outcome).axes) == 15
    assert len(figure_recovery(outcome).axes) == 3
