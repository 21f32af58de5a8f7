"""Every method on a part tree, and every resampling scheme, against the Kalman filter.

Tests of one file share compiled kernels, because an ordering is data: run the files of this
folder whole.  A scheme is another kernel: the quick part has one scheme for all orderings.
"""

import pytest
from exact import LIMIT, ORDERINGS, QUICK_RUNS, TREE, WRONG, problem, scores

from jaxpf import ordering, resampling

pytestmark = pytest.mark.statistical

QUICK_SCHEME, QUICK = "systematic", ("ps-021", "dps", "sps-combinatorial")
OTHER_SCHEMES = [scheme for scheme in resampling.SCHEMES if scheme != QUICK_SCHEME]


@pytest.mark.parametrize(
    "name",  # sir is a program of its own; of independent objects it is among the quick tests
    [
        pytest.param(n, marks=[pytest.mark.slow] + [pytest.mark.always] * (n == "sir"))
        if n not in QUICK
        else n
        for n in ORDERINGS
    ],
)
def test_filter_on_a_part_tree_is_unbiased(name):
    settings = {"resampling": QUICK_SCHEME, "runs": QUICK_RUNS}
    assert scores(problem(TREE), ORDERINGS[name], **settings).worst < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("scheme", OTHER_SCHEMES)
@pytest.mark.parametrize("name", ["dps", "sps-combinatorial"])
def test_filter_on_a_part_tree_is_unbiased_under_every_scheme(name, scheme):
    assert scores(problem(TREE), ORDERINGS[name], resampling=scheme).worst < LIMIT


def test_sorted_swap_is_biased_in_its_evidence_by_far():
    found = scores(problem(TREE), ordering.sps(TREE, "sorted"), runs=QUICK_RUNS)
    assert found.evidence > 3 * WRONG


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ps-012", "sps-combinatorial"])
def test_filter_with_missing_frames_is_unbiased(name):
    exact = problem(TREE, num_frames=4, missing=(1, 2))
    assert scores(exact, ORDERINGS[name], resampling=QUICK_SCHEME).worst < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ps-012", "dps", "sps-combinatorial"])
def test_filter_with_missing_partitions_is_unbiased(name):
    """A root that is hidden, a leaf, and a whole frame."""
    exact = problem(TREE, num_frames=4, missing=(2,), hidden=((0, 1), (1, 0), (3, 2)))
    assert scores(exact, ORDERINGS[name], resampling=QUICK_SCHEME).worst < LIMIT
