"""How sure a filter is that its objects are there."""

import numpy as np
from tagged_walk import Breakable, P, T, frames, track, tracked

from jaxpf import ordering, pytree_dataclass


@pytree_dataclass
class Telling(Breakable):
    """Says of an object what stands in the place of the edge, whatever the estimate is."""

    def log_odds(self, observation, partition, substate):
        return observation[partition, 1]


def told(observed=None):
    """The summary of a run of which the likelihood tells."""
    return track(ordering.dps(P), observed, likelihood=Telling(np.float32(0.7)))[1]


def test_log_odds_are_smoothed_over_the_past_and_bounded():
    observed = frames()
    said = np.array([[1.0, -4.0, np.nan], [2.0, 50.0, 1.0], [-0.5, 0.0, -np.inf]], np.float32)
    assert said.shape == (T, P)
    observed[:, :, 1] = said
    summary = told(observed)
    expected, known = [], np.full(P, 3.0)
    for frame in np.clip(np.nan_to_num(said, nan=-6.0, neginf=-6.0), -6, 6):
        known = (known + frame) / 2
        expected.append(1 / (1 + np.exp(-known)))
    np.testing.assert_allclose(summary.confidence, expected, rtol=1e-5)


def test_a_likelihood_that_cannot_tell_is_not_asked():
    state, summary = tracked("dps")
    assert summary.confidence is None
    assert state.log_odds is None


def test_what_is_said_changes_no_particle():
    (_, plain), telling = tracked("dps"), told()
    assert np.isfinite(telling.confidence).all()
    for name in ("estimate", "log_evidence", "spread"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(telling, name))
