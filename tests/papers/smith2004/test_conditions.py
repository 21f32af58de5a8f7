"""What the paper leaves open, varied: other endings of a frame."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf.dynamics import LinearGaussian
from jaxpf.likelihoods import Gaussian
from jaxpf.papers.smith2004 import scenes as conditions

ONE = jnp.ones((3, 1, 1))
FRAME = jnp.array([[0.5], [-1.0], [2.0]])
#: Two components that end with other partitions.
TRACKER = jaxpf.Partitioned(
    dynamics=LinearGaussian(transition=ONE, noise=ONE),
    likelihood=Gaussian(noise=ONE),
    ordering=jaxpf.ordering.dps(orders=[[0, 1, 2], [2, 0, 1]]),
    initial=jnp.zeros((3, 1)),
    num_particles=200,
)


KEY = jax.random.key(3)


@functools.cache
def start():
    """The state before the frame, and the library's after it."""
    state = jax.jit(TRACKER.init)(jax.random.key(0))
    return state, jax.jit(TRACKER.step)(jax.random.split(KEY)[0], state, FRAME)[0]


def ended(**how):
    """The library's state after a frame, the other one's, and its summary."""
    state, here = start()
    tracker = conditions.OtherEnding(TRACKER, **how)
    return here, *jax.jit(tracker.step)(KEY, state, FRAME)


@pytest.mark.slow
def test_all_partitions_but_the_last_of_the_order_count_twice():
    here, there, summary = ended(counts_twice=True)
    values = np.asarray(here.substates)[..., 0]  # [N, P]
    scores = -((values - np.asarray(FRAME)[:, 0]) ** 2) / 2
    last = np.array([2, 1])[np.asarray(here.component)]
    assert set(last) == {1, 2}
    expected = np.asarray(here.log_weights) + scores.sum(axis=1)
    expected -= scores[np.arange(200), last]
    expected -= np.logaddexp.reduce(expected)
    np.testing.assert_allclose(there.log_weights, expected, rtol=1e-4, atol=1e-4)
    mean = np.exp(expected) @ values
    np.testing.assert_allclose(summary.estimate[:, 0], mean, rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_drawing_again_leaves_equal_weights_and_copies():
    here, there, early = ended(draws_again=True)
    np.testing.assert_allclose(np.exp(there.log_weights), 1 / 200, rtol=1e-5)
    assert {tuple(x) for x in np.asarray(there.lineage).T} < {
        tuple(x) for x in np.asarray(here.lineage).T
    }
    _, _, late = ended(draws_again=True, reads_late=True)
    drawn = np.asarray(there.substates)[..., 0]
    np.testing.assert_allclose(late.estimate[:, 0], drawn.mean(axis=0), rtol=1e-4)
    apart = np.asarray(late.estimate - early.estimate)[:, 0]
    assert np.all(apart != 0)
    assert np.all(np.abs(apart) < 4.5 * drawn.std(axis=0) / np.sqrt(200))
