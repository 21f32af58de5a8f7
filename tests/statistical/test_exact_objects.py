"""Independent objects with a second-order motion: lags must travel with their object.

Every method against the Kalman filter, and whether it treats identical objects alike.
"""

import numpy as np
import pytest
import scipy.stats
from exact import LIMIT, OBJECTS, QUICK_RUNS, WRONG, objects, record_runs, scores, scores_of

from jaxpf import ordering

pytestmark = pytest.mark.statistical


ORDERINGS = {
    "sir": ordering.sir(4),
    "ps-0123": ordering.ps([0, 1, 2, 3]),
    "ps-3120": ordering.ps([3, 1, 2, 0]),
    "dps": ordering.dps(4),
    "dps-3": ordering.dps(orders=[[2, 0, 3, 1], [3, 2, 1, 0], [0, 1, 3, 2]]),
    "sps-no-exchange": ordering.sps(OBJECTS, exchange_roots=False),
}
SLOW = "ps-0123", "dps-3"


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=[pytest.mark.slow] * (x in SLOW)) for x in ORDERINGS]
)
def test_filter_of_independent_objects_is_unbiased(name):
    assert scores(objects(), ORDERINGS[name], runs=QUICK_RUNS).worst < LIMIT


def test_the_combinatorial_swap_is_unbiased_and_the_yardstick_notices_what_is_slightly_wrong():
    exact, recorded = objects(), record_runs(objects(), ordering.sps(OBJECTS), runs=10_000)
    assert scores_of(recorded, exact).worst < LIMIT
    more_evidence = exact._replace(log_evidence=exact.log_evidence + np.log(1.1) / 3)
    assert abs(scores_of(recorded, more_evidence).evidence) > LIMIT
    more_variance = exact._replace(variance=1.2 * exact.variance)
    assert np.abs(scores_of(recorded, more_variance).seconds).max() > LIMIT


def test_literal_reassembly_is_biased_in_its_means():
    """The paper's rule throws the components' evidence away."""
    literal = scores(objects(), ordering.dps(4, reassembly="literal"), runs=QUICK_RUNS)
    assert np.abs(literal.means).max() > 2 * WRONG


def test_sorted_swap_of_objects_is_biased_by_far():
    found = scores(objects(), ordering.sps(OBJECTS, "sorted"), runs=QUICK_RUNS)
    assert found.evidence > 3 * WRONG


def p_values(order):
    """Friedman's test over objects, of squared errors and distinct particles in the last frame."""
    exact = objects(same_frames=True)
    recorded = record_runs(exact, order, runs=QUICK_RUNS)
    _, mean, _, distinct_share = (np.asarray(part)[:, -1] for part in recorded)
    errors = (mean - exact.mean[-1]) ** 2
    return [
        scipy.stats.friedmanchisquare(*measure.T).pvalue for measure in (errors, distinct_share)
    ]


@pytest.mark.slow
def test_dps_treats_identical_objects_alike():
    assert min(p_values(ordering.dps(4))) > 1e-3


def test_sps_treats_identical_objects_alike():
    assert min(p_values(ordering.sps(OBJECTS))) > 1e-3


def test_ps_treats_identical_objects_unlike():
    assert max(p_values(ordering.ps([0, 1, 2, 3]))) < 1e-6
