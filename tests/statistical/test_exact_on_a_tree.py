"""Every method on a part tree, under every resampling scheme, against the Kalman filter.

Tests of one file share compiled kernels, because an ordering is data: run the files of this
folder whole (``pytest -n 2 --dist loadfile``).
"""

import pytest
from exact import LIMIT, TREE, WRONG, problem, scores

from jaxpf.filters import resampling
from jaxpf.filters.partitioned import ordering

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


def both_tree_orders():
    return ordering.dps(orders=[[0, 1, 2], [0, 2, 1]])


@pytest.mark.parametrize("scheme", resampling.SCHEMES)
@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: ordering.sir(3), id="sir"),
        pytest.param(lambda: ordering.ps([0, 1, 2]), id="ps-012"),
        pytest.param(lambda: ordering.ps([0, 2, 1]), id="ps-021"),
        pytest.param(both_tree_orders, id="dps"),
        pytest.param(lambda: ordering.sps(TREE, "none"), id="sps-none"),
        pytest.param(lambda: ordering.sps(TREE, "random"), id="sps-random"),
        pytest.param(lambda: ordering.sps(TREE, "combinatorial"), id="sps-combinatorial"),
    ],
)
def test_filter_on_a_part_tree_is_unbiased_under_every_scheme(make, scheme):
    assert scores(problem(TREE), make(), resampling=scheme).worst < LIMIT


def test_sorted_swap_is_biased_in_its_evidence_by_far():
    assert scores(problem(TREE), ordering.sps(TREE, "sorted")).evidence > 3 * WRONG
