"""What measures refuse, and what they name: one row for each rule."""

import math

import jax
import numpy as np
import pytest
from refusals import every, message_of

from jaxpf import measures
from jaxpf.measures import (
    difference_interval,
    distance_precision,
    mean_interval,
    median_interval,
    success_auc,
)

TRUTH = np.ones((5, 3, 4))


@pytest.mark.parametrize("level", [-1, 0, 1, 95, math.nan, [0.9, 0.95]])
def test_a_level_that_is_no_probability_is_refused(level):
    named = "must be above 0 and below 1"
    for interval in (mean_interval, median_interval):
        assert named in message_of(interval, [1.0, 2.0, 3.0], level=level)
    assert named in message_of(difference_interval, [0.5, 1.0], [0.2, 0.3], level)


@pytest.mark.parametrize("measure", [measures.success, measures.recovery])
@pytest.mark.parametrize("shape", [(5, 2, 4), (5, 1, 4), (4, 3, 4), (3, 4)])
def test_boxes_of_other_frames_or_objects_are_refused(measure, shape):
    message = message_of(measure, np.ones(shape), TRUTH)
    assert "same frames and objects" in message or "[..., T, P, 4]" in message


@every([
    (lambda: measures.mean_recall(TRUTH, TRUTH, over="some"), '"tracked" or "all"'),
    (lambda: measures.summarise(TRUTH, TRUTH), "[R, T, P, 4]"),
    (lambda: measures.summarise(np.ones((5, 3, 1, 4)), np.ones((3, 2, 4))), "[5, 3, 1, 4]"),
    (lambda: jax.jit(mean_interval)(np.ones(5)), "call them outside of jit"),
    *((lambda score=score: score(TRUTH[:, :2], TRUTH), "same frames and objects")
      for score in (success_auc, distance_precision)),
])  # fmt: skip
def test_what_does_not_fit_is_refused(call, named):
    assert named in message_of(call)
