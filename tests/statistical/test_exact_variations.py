"""When and by what to resample: adaptive, tempered and weighted resampling are unbiased."""

import pytest
from exact import LIMIT, ORDERINGS, TREE, problem, scores

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


@pytest.mark.parametrize(
    ("name", "threshold"),
    [
        *(("sir", 0.8), ("ps-021", 0.5), ("dps", 0.5), ("dps", 0.8)),
        *(("sps-random", 0.8), ("sps-combinatorial", 0.5)),
    ],
)
def test_adaptive_resampling_is_unbiased(name, threshold):
    assert scores(problem(TREE), ORDERINGS[name], ess_threshold=threshold).worst < LIMIT


@pytest.mark.parametrize(
    ("name", "tempering"), [("ps-012", 0.3), ("dps", 0.3), ("dps", 1.0), ("sps-none", 1.0)]
)
def test_tempered_weighting_functions_are_unbiased(name, tempering):
    assert scores(problem(TREE), ORDERINGS[name], tempering=tempering).worst < LIMIT


@pytest.mark.parametrize("name", ["sir", "ps-021", "dps", "sps-none"])
def test_joint_likelihood_that_does_not_factor_is_unbiased(name):
    assert scores(problem(TREE, correlation=0.5), ORDERINGS[name]).worst < LIMIT
