"""Linear-Gaussian observations, and exact Kalman filtering for tests and teaching."""

import math

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import Likelihood
from jaxpf.contract.calls import of_partition
from jaxpf.contract.numbers import with_nan
from jaxpf.contract.pytree import pytree_dataclass


@pytree_dataclass
class Gaussian(Likelihood):
    """``y^p = H x^p + L n`` for each partition; a frame is ``y``, ``[P, E]``.

    Components of y that are NaN are missing: the others keep their marginal density.

    Attributes:
        noise: L, ``[P, E, E]``, lower triangular square root of the noise covariance.
        observation: H, ``[P, E, D]``; None observes the substate itself.
    """

    noise: jax.Array
    observation: jax.Array | None = None

    #: ``log_prob`` is differentiable in the substate.
    state_gradient = True
    handles_nan = True

    def observe(self, frame):
        """The frame itself, ``[P, E]``."""
        return frame

    def log_prob_all(self, observation, partition, substates):
        """Log-densities ``[N]`` given substates ``[D, N]``."""
        dtype = substates.dtype
        frame = jnp.asarray(observation, dtype)
        seen = ~jnp.isnan(frame)
        frame = jnp.where(seen, frame, 0)
        noise = _noise_of_seen(jnp.asarray(self.noise, dtype), seen)
        whitener = jnp.linalg.inv(noise)
        # Whiten the observation once per partition; per particle only E x D products remain.
        target = jnp.einsum("pef,pf->pe", whitener, frame)
        design = whitener * seen[:, None, :]
        if self.observation is not None:
            design = design @ jnp.asarray(self.observation, dtype)
        log_normaliser = jnp.sum(
            jnp.log(jnp.abs(jnp.diagonal(noise, axis1=-2, axis2=-1))), axis=-1
        ) + 0.5 * math.log(2 * math.pi) * jnp.sum(seen, axis=-1)
        squares = jnp.zeros(substates.shape[1:], dtype)
        for row in range(design.shape[1]):
            residual = of_partition(target[:, row], partition)
            for column in range(design.shape[2]):
                factor = of_partition(design[:, row, column], partition)
                residual = residual - factor * substates[column]
            squares = squares + residual**2
        return -0.5 * squares - of_partition(log_normaliser, partition)

    def sample(self, key, substates):
        """Draw a frame ``[P, E]``, given substates ``[P, D]``."""
        noise = jnp.asarray(self.noise, substates.dtype)
        drawn = jax.random.normal(key, noise.shape[:-1], noise.dtype)
        seen = substates
        if self.observation is not None:
            seen = jnp.einsum("ped,pd->pe", jnp.asarray(self.observation, noise.dtype), substates)
        return seen + jnp.einsum("pef,pf->pe", noise, drawn)


def _noise_of_seen(noise: jax.Array, seen: jax.Array) -> jax.Array:
    """Square roots ``[P, E, E]`` of the covariances of components ``seen`` ``[P, E]``.

    The others get unit noise, independent of the rest.
    """
    both = seen[:, :, None] & seen[:, None, :]
    covariance = jnp.where(both, noise @ jnp.swapaxes(noise, -1, -2), jnp.eye(noise.shape[-1]))
    all_seen = seen.all(axis=-1)[:, None, None]
    # The given root where nothing is missing: its signs and last bits stay.
    return jnp.where(all_seen, noise, jnp.linalg.cholesky(covariance))


def kalman(
    transition: np.ndarray,
    process_covariance: np.ndarray,
    observation: np.ndarray,
    noise_covariance: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
    frames: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Exact filtering of ``z_t = A z_{t-1} + q``, ``y_t = H z_t + r``, in float64.

    Args:
        transition: A, ``[S, S]``.
        process_covariance: of q, ``[S, S]``.
        observation: H, ``[E, S]``.
        noise_covariance: of r, ``[E, E]``.
        mean: ``[S]``, of the state before the first frame.
        covariance: ``[S, S]``, of the same state.
        frames: ``[T, E]``; NaN marks missing data.

    Returns:
        Log evidence increments ``[T]``, filtered means ``[T, S]`` and covariances
        ``[T, S, S]``.
    """
    model = transition, process_covariance, observation, noise_covariance, mean, covariance
    transition, process_covariance, observation, noise_covariance, mean, covariance = (
        np.asarray(each, float) for each in model
    )
    frames = np.asarray(with_nan(frames), float)
    log_evidence, means, covariances = [], [], []
    for frame in frames:
        mean = transition @ mean
        covariance = transition @ covariance @ transition.T + process_covariance
        seen = ~np.isnan(frame)
        of_seen = observation[seen]
        innovation = frame[seen] - of_seen @ mean
        spread = of_seen @ covariance @ of_seen.T + noise_covariance[np.ix_(seen, seen)]
        gain = np.linalg.solve(spread, of_seen @ covariance).T
        log_evidence.append(
            -0.5 * innovation @ np.linalg.solve(spread, innovation)
            - 0.5 * np.linalg.slogdet(2 * np.pi * spread)[1]
        )
        mean = mean + gain @ innovation
        covariance = covariance - gain @ spread @ gain.T
        means.append(mean)
        covariances.append(covariance)
    return np.array(log_evidence), np.array(means), np.array(covariances)


def stacked_model(dynamics, parents: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """``LinearGaussian`` dynamics on a part tree, as one system over ``(x_t, x_{t-1})``.

    Solves the within-frame coupling ``(I - C) x_t = A x_{t-1} + B x_{t-2} + L n``.

    Returns:
        Transition ``[2PD, 2PD]`` and process covariance ``[2PD, 2PD]`` for ``kalman``;
        the state is ordered partition by partition.
    """
    count, dimension = np.shape(dynamics.transition)[:2]
    size = count * dimension

    def in_columns(blocks, columns):
        """Blocks ``[P, D, D]``, or None, each in the columns of a partition; -1 is none."""
        whole = np.zeros((count, dimension, count, dimension))
        for p, column in enumerate(columns):
            if blocks is not None and column >= 0:
                whole[p, :, column] = blocks[p]
        return whole.reshape(size, size)

    own = range(count)
    solve = np.linalg.inv(np.eye(size) - in_columns(dynamics.coupling, parents))
    stacked, covariance = np.zeros((2, 2 * size, 2 * size))
    stacked[:size, :size] = solve @ in_columns(dynamics.transition, own)
    stacked[:size, size:] = solve @ in_columns(dynamics.lag, own)
    stacked[size:, :size] = np.eye(size)
    root = solve @ in_columns(dynamics.noise, own)
    covariance[:size, :size] = root @ root.T
    return stacked, covariance
