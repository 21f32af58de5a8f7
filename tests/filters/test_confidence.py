"""How sure a filter is that its objects are there."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import partitioned
from tagged_walk import Breakable, P, track, tracked

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.filters import SideBySide, WithErrorBars


@pytree_dataclass
class Telling(Breakable):
    """Says of an object what stands in the place of the edge, whatever the estimate is."""

    def log_odds(self, observation, partition, substate):
        return observation[partition, 1]


def told(observed=None):
    """The summary of a run of which the likelihood tells."""
    return track(ordering.dps(P), observed, likelihood=Telling(np.float32(0.7)))[1]


def test_a_likelihood_that_cannot_tell_is_not_asked():
    state, summary = tracked("dps")
    assert summary.confidence is None
    assert state.presence is None


@pytest.mark.slow
@pytest.mark.always
def test_what_is_said_changes_no_particle():
    (_, plain), telling = tracked("dps"), told()
    assert np.isfinite(telling.confidence).all()
    for name in ("estimate", "log_evidence", "spread"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(telling, name))


@pytree_dataclass
class ByFrame:
    """Log odds that stand in the frame."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * substate[0] ** 2

    def log_odds(self, observation, partition, substate):
        return observation[partition]


@pytest.mark.slow
@pytest.mark.parametrize(
    "wrapped",
    [
        pytest.param(lambda bare: bare, marks=pytest.mark.always),
        # Runs side by side differ in estimates, and these odds depend on none.
        lambda bare: SideBySide(WithErrorBars(bare), 2),
    ],
    ids=["bare", "wrapped"],
)
def test_a_confidence_stays_in_missing_frames(wrapped):
    frames, key = np.array([[1.0, -4.0], [np.nan] * 2, [np.nan] * 2, [2.0, 0.0]]), jax.random.key(0)
    its = wrapped(partitioned(likelihood=ByFrame()))
    observed = np.array([[True, True], [False, False], [False, True], [True, True]])
    frames[2, 1] = 3.0  # of the other partition alone
    summary = jaxpf.run(its, key, frames, observed=observed)[1]
    expected = 1 / (1 + np.exp(-np.array([[2, -0.5], [2, -0.5], [2, 1.25], [2, 0.625]])))
    np.testing.assert_allclose(summary.confidence, expected, rtol=1e-5)


@pytree_dataclass
class AtBorder(ByFrame):
    """The second object stands at the border."""

    def reaches_border(self, partition, substates):
        return partition == 1


@pytest.mark.slow
@pytest.mark.always
def test_who_was_lost_at_the_border_needs_more_evidence_to_be_back():
    """While an object counts as gone, a missing frame changes nothing."""
    said = np.array([1.0, -6.0, 6.0, 3.0, np.nan, 6.0, 6.0])
    frames = np.stack([said, said], axis=1)
    its = partitioned(likelihood=AtBorder())
    state, summary = jaxpf.run(its, jax.random.key(0), frames, observed=~np.isnan(said))
    odds = np.array([2, -2, 2, 2.5, 2.5, 4.25, 5.125])
    less = np.array([0, 4, 4, 4, 4, 0, 0])
    expected = 1 / (1 + np.exp(-np.stack([odds, odds - less], axis=1)))
    np.testing.assert_allclose(summary.confidence, expected, rtol=1e-5)
    assert not state.presence.left.any()


@pytree_dataclass
class InOnePlace(ByFrame):
    """In the frames' third column stands how far both objects are in one place."""

    handles_nan = True

    def same_place(self, partition, substates):
        return jnp.where(jnp.eye(2, dtype=bool), 1.0, substates[0, 0])

    def log_prob(self, observation, partition, substate):
        return -1e4 * (substate[0] - observation[2]) ** 2


def test_the_weaker_of_two_objects_in_one_place_is_doubted_more_and_more():
    """And a missing frame changes nothing; what is said is bounded by 6."""
    said = np.array([[3, 2], [3, 3], [np.nan] * 2, [3, 3], [-3, 3], [50, -np.inf], [np.nan, 50]])
    shared = np.array([1.0, 0.5, np.nan, 0.0, 1.0, 0.0, 0.0])
    frames = np.column_stack([said, shared])
    its = partitioned(likelihood=InOnePlace(), num_particles=20_000)
    seen = ~np.isnan(shared)
    state, summary = jaxpf.run(its, jax.random.key(0), frames, observed=seen)
    odds = [3, 3, 3, 3, 0, 3, -1.5], [2.5, 2.75, 2.75, 2.875, 2.9375, -1.53125, 2.234375]
    odds = np.transpose(odds)
    first = 0.03 * np.array([0, 0, 0, 0, 1, 0.97, 0.97**2])
    second = np.full(7, 0.03 * 0.97 + 0.015) * 0.97 ** np.array([0, 0, 0, 1, 2, 3, 4])
    second[0] = 0.03
    together = np.stack([first, second], axis=1)
    expected = 1 / (1 + np.exp(4 * together - odds))
    np.testing.assert_allclose(summary.confidence, expected, atol=3e-4)
    np.testing.assert_allclose(state.presence.together, together[-1], atol=1e-3)


def test_one_object_alone_is_not_compared():
    its = partitioned(ordering.ps([0]), likelihood=InOnePlace())
    assert jax.eval_shape(its.init, jax.random.key(0)).presence.together is None
