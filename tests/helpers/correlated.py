"""A likelihood that does not factor; a Kalman filter computes its exact posterior."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import pytree_dataclass


@pytree_dataclass
class CorrelatedGaussian:
    """One-dimensional partitions, observed with noise that is correlated between them.

    The joint likelihood does not factor.  ``log_prob`` is the marginal of one partition and serves
    as the weighting function; ``log_joint`` is the true density.  A frame is ``[P]``.

    Attributes:
        covariance: ``[P, P]`` of the observation noise.
    """

    covariance: jax.Array

    #: ``log_prob`` is differentiable in the substate.
    state_gradient = True

    def observe(self, frame):
        """The frame itself, ``[P]``."""
        return frame

    def log_prob(self, observation, partition, substate):
        """Marginal log-density ``[]`` of one partition."""
        variance = jnp.diagonal(self.covariance)[partition]
        return -0.5 * (
            (observation[partition] - substate[0]) ** 2 / variance + jnp.log(2 * np.pi * variance)
        )

    def log_joint(self, observation, substates, log_probs):
        """Log-density ``[]`` of all partitions together."""
        residual = observation - substates[:, 0]
        return jax.scipy.stats.multivariate_normal.logpdf(
            residual, jnp.zeros_like(residual), self.covariance
        )
