"""The one rule that says when an object is lost."""

import numpy as np

from jaxpf.contract.lost import LOST_BELOW, judge

OUTSIDE = np.array([False, True, False, False, False])
HOPELESS = np.array([False, False, True, False, False])


def test_an_object_is_lost_outside_without_likelihood_or_in_doubt():
    given = np.array([0.9, 0.9, 0.9, LOST_BELOW - 0.01, LOST_BELOW])
    confidence, lost = judge(OUTSIDE, HOPELESS, given)
    np.testing.assert_array_equal(lost, [False, True, True, True, False])
    # So confidence alone says it, and keeps its value where the object may be there.
    np.testing.assert_array_equal(confidence, [0.9, 0, 0, LOST_BELOW - 0.01, LOST_BELOW])
    np.testing.assert_array_equal(lost, confidence < LOST_BELOW)


def test_without_confidence_only_the_reasons_count_and_an_unknown_one_is_none():
    confidence, lost = judge(OUTSIDE, HOPELESS)
    assert confidence is None
    np.testing.assert_array_equal(lost, [False, True, True, False, False])
    assert not judge(np.zeros(1, bool), np.zeros(1, bool), np.array([np.nan]))[1].any()
