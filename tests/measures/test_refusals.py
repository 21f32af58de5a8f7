"""What measures refuse: a range of a number."""

import math

import pytest
from refusals import message_of

from jaxpf.measures import difference_interval, mean_interval, median_interval


@pytest.mark.parametrize("level", [-1, 0, 1, 95, math.nan])
def test_a_level_that_is_no_probability_is_refused(level):
    named = "must be above 0 and below 1"
    for interval in (mean_interval, median_interval):
        assert named in message_of(interval, [1.0, 2.0, 3.0], level=level)
    assert named in message_of(difference_interval, [0.5, 1.0], [0.2, 0.3], level)
