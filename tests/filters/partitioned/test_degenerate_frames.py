"""Frames that no particle explains, invalid likelihoods, lost objects."""

import numpy as np
import pytest
from tagged_walk import METHODS, N, P, TaggedWalk, every_method, frames, track

from jaxpf import ordering
from jaxpf.contract.state import (
    STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD,
    STATUS_OK,
    STATUS_WITHOUT_LIKELIHOOD,
)


@every_method
@pytest.mark.parametrize("bad", [np.nan, np.inf], ids=["nan", "inf"])
def test_invalid_likelihoods_are_impossible_and_counted(method, bad):
    state, summary = track(METHODS[method](), frames(0.3, bad, partition=1))
    assert (summary.status == [STATUS_OK, STATUS_INVALID_LIKELIHOOD, STATUS_OK]).all()
    assert summary.num_invalid[0] == summary.num_invalid[2] == 0
    assert 0 < summary.num_invalid[1] < N
    weights = np.exp(np.asarray(state.log_weights)[1])
    assert not weights[np.asarray(state.substates)[1, :, 1, 0] > 0.3].any()
    assert np.isfinite(summary.log_evidence).all()
    assert np.isfinite(summary.estimate).all()


def test_invalid_likelihoods_are_counted_one_by_one():
    state, summary = track(ordering.sir(P), frames(0.3, np.nan))
    beyond = np.asarray(state.substates)[1, :, :, 0] > 0.3
    assert summary.num_invalid[1] == beyond.sum()


@every_method
def test_an_impossible_frame_is_reported_and_left_out(method):
    state, summary = track(METHODS[method](), frames(-np.inf, -np.inf))
    assert summary.status[1] == STATUS_IMPOSSIBLE + STATUS_WITHOUT_LIKELIHOOD
    assert summary.without_likelihood[1].all()
    assert np.isneginf(summary.log_evidence[1])
    assert (np.asarray(summary.ess) > 0).tolist() == [True, False, True]
    # The weights are what they were: equal, since the frame began with a resampling.
    np.testing.assert_allclose(state.log_weights[1], -np.log(N), rtol=1e-5)
    assert np.isfinite(summary.estimate).all()
    assert np.isfinite(summary.spread).all()
    assert (summary.status[[0, 2]] == STATUS_OK).all()
    assert np.isfinite(summary.log_evidence[np.array([0, 2])]).all()


@every_method
def test_a_lost_object_is_named_and_the_others_are_tracked_on(method):
    _, summary = track(METHODS[method](), frames(-np.inf, -np.inf, partition=1))
    np.testing.assert_array_equal(
        summary.without_likelihood, [[False] * 3, [False, True, False], [False] * 3]
    )
    assert summary.status[1] == STATUS_IMPOSSIBLE + STATUS_WITHOUT_LIKELIHOOD
    assert np.isneginf(summary.log_evidence[1])
    assert np.isfinite(summary.estimate).all()
    # The other objects' likelihoods still count: as they do in the same run without object 1.
    sure = np.asarray(summary.spread)[1, [0, 2], 0]
    unsure = np.asarray(summary.spread)[1, 1, 0]
    assert (sure < 0.9 * unsure).all()


def test_objects_of_dead_particles_may_be_anything():
    """A dead particle that holds NaN does not spoil the estimate."""
    dynamics = TaggedWalk(np.float32(1.0), edge=np.float32(1.5))
    state, summary = track(ordering.sir(P), frames(0.3, np.nan), dynamics=dynamics)
    assert np.isnan(np.asarray(state.substates)[1]).any()
    assert np.isfinite(summary.estimate[1]).all()
    assert np.isfinite(summary.spread[1]).all()
