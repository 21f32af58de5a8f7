"""When and by what to resample: adaptive, tempered and weighted resampling are unbiased."""

import pytest
from exact import LIMIT, TREE, problem, scores

from jaxpf import ordering

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


def both_tree_orders():
    return ordering.dps(orders=[[0, 1, 2], [0, 2, 1]])


@pytest.mark.parametrize(
    ("make", "threshold"),
    [
        pytest.param(lambda: ordering.sir(3), 0.8, id="sir"),
        pytest.param(lambda: ordering.ps([0, 2, 1]), 0.5, id="ps"),
        pytest.param(both_tree_orders, 0.5, id="dps"),
        pytest.param(both_tree_orders, 0.8, id="dps-more-often"),
        pytest.param(lambda: ordering.sps(TREE, "random"), 0.8, id="sps-random"),
        pytest.param(lambda: ordering.sps(TREE), 0.5, id="sps-combinatorial"),
    ],
)
def test_adaptive_resampling_is_unbiased(make, threshold):
    assert scores(problem(TREE), make(), ess_threshold=threshold).worst < LIMIT


@pytest.mark.parametrize(
    ("make", "tempering"),
    [
        pytest.param(lambda: ordering.ps([0, 1, 2]), 0.3, id="ps"),
        pytest.param(both_tree_orders, 0.3, id="dps"),
        pytest.param(both_tree_orders, 1.0, id="dps-not-tempered"),
        pytest.param(lambda: ordering.sps(TREE, "none"), 1.0, id="sps-none"),
    ],
)
def test_tempered_weighting_functions_are_unbiased(make, tempering):
    assert scores(problem(TREE), make(), tempering=tempering).worst < LIMIT


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: ordering.sir(3), id="sir"),
        pytest.param(lambda: ordering.ps([0, 2, 1]), id="ps"),
        pytest.param(both_tree_orders, id="dps"),
        pytest.param(lambda: ordering.sps(TREE, "none"), id="sps-none"),
    ],
)
def test_joint_likelihood_that_does_not_factor_is_unbiased(make):
    assert scores(problem(TREE, correlation=0.5), make()).worst < LIMIT
