"""The block particle filter against its limit of many particles, which is known exactly.

For a linear-Gaussian chain that limit is a Kalman filter whose predicted covariance loses all
entries between blocks in every frame.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, WRONG
from refusals import message_of

import jaxpf
from jaxpf import contract
from jaxpf.likelihoods import Gaussian

KEY = jax.random.key(11)
NUM_FRAMES = 6


@jaxpf.pytree_dataclass
class Chain(contract.CoupledDynamics):
    """``x_t = matrix x_{t-1} + n`` of all coordinates, in P blocks of D."""

    matrix: Any  # [P, D, P * D]

    def propagate_all(self, key, partition, current, previous, parent, others):
        whole = others.reshape(-1, others.shape[-1])
        mean = jnp.einsum("ndk,kn->dn", jnp.asarray(self.matrix)[partition], whole)
        return mean + jax.random.normal(key, mean.shape, mean.dtype)


def chain_of(size):
    """Matrix ``[S, S]``: a coordinate keeps half, and takes a quarter of each neighbour."""
    return 0.5 * np.eye(size) + 0.25 * (np.eye(size, k=1) + np.eye(size, k=-1))


def frames_of(size):
    rng, x, frames = np.random.default_rng(1), np.zeros(size), []
    for _ in range(NUM_FRAMES):
        x = chain_of(size) @ x + rng.normal(size=size)
        frames.append(x + rng.normal(size=size))
    return np.array(frames)


def block_kalman(size, width):
    """Filtered means ``[S]`` and variances of the last frame, and the log evidence."""
    matrix, same = chain_of(size), np.kron(np.eye(size // width), np.ones((width, width)))
    mean, covariance, log_evidence = np.zeros(size), np.zeros((size, size)), 0.0
    for y in frames_of(size):
        mean, covariance = matrix @ mean, same * (matrix @ covariance @ matrix.T + np.eye(size))
        spread, residual = covariance + np.eye(size), y - mean
        gain = np.linalg.solve(spread, covariance).T
        log_evidence -= 0.5 * residual @ np.linalg.solve(spread, residual)
        log_evidence -= 0.5 * np.linalg.slogdet(2 * np.pi * spread)[1]
        mean, covariance = mean + gain @ residual, covariance - gain @ covariance
    return mean, np.diag(covariance), log_evidence


def tracker(size, width, ordering=jaxpf.ordering.blocks, **settings):
    count = size // width
    return jaxpf.Partitioned(
        dynamics=Chain(chain_of(size).reshape(count, width, size)),
        likelihood=Gaussian(np.tile(np.eye(width), (count, 1, 1))),
        ordering=ordering(count),
        initial=np.zeros((count, width)),
        **settings,
    )


def last_means(size, width):
    """Estimates of the last frame, ``[R, S]``."""
    its = tracker(size, width, num_particles=1000)
    frames = frames_of(size).reshape(NUM_FRAMES, -1, width)

    def last(key):
        return jaxpf.run(its, key, frames)[1].estimate[-1].reshape(size)

    keys = jax.random.split(KEY, 50)
    return np.asarray(jax.jit(lambda keys: jax.lax.map(last, keys))(keys), float)


@pytest.mark.parametrize("size", [16, pytest.param(64, marks=pytest.mark.slow)])
def test_the_bias_falls_with_the_size_of_the_blocks(size):
    """In posterior standard deviations, of the limit of many particles."""
    mean, variance, _ = block_kalman(size, size)
    widths = [1, 2, 4, 8, size]
    bias = [
        np.sqrt(np.mean((block_kalman(size, width)[0] - mean) ** 2 / variance)) for width in widths
    ]
    assert np.all(np.diff(bias) < 0)
    assert 0.08 < bias[0] < 0.1  # whatever the number of coordinates
    assert bias[2] < bias[0] / 2
    assert bias[-1] == 0


@pytest.mark.slow
@pytest.mark.parametrize(("size", "width"), [(16, 4), (64, 1), (64, 4)])
def test_blocks_have_their_own_limit_of_many_particles(size, width):
    """And not the exact means."""
    means = last_means(size, width)
    error = means.std(0) / len(means) ** 0.5
    own, exact = (
        np.abs((means.mean(0) - block_kalman(size, each)[0]) / error).max()
        for each in (width, size)
    )
    assert own < LIMIT
    assert exact > WRONG


def test_the_bias_is_said_and_coupled_dynamics_need_blocks_by_name():
    biases = [bias.cause for bias in contract.evidence_biases(tracker(16, 4)) if bias.applies]
    assert biases == ["ordering.blocks of coupled dynamics"]
    by_levels = lambda count: jaxpf.ordering.sps(num_partitions=count)  # noqa: E731
    assert "ordering.blocks" in message_of(tracker, 16, 4, by_levels)
