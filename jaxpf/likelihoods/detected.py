"""A detector's word beside the picture's: where somebody was found, with the chance of an error.

The likelihood of a picture is multiplied, for a target that was detected, by::

    (exp(-r^2 / 2) + c) / (1 + c),   r^2 = sum over coordinates of ((x - found) / scale)^2

with c for a detection that is of somebody else, so that a wrong one cannot drive a target's
particles away; nothing is said of a target that was not detected.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract import Likelihood, log_prob_all
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.likelihoods.wrapped import WrappedLikelihood

#: c: beyond three standard deviations a detection hardly counts.
_OTHERS = 0.01


@pytree_dataclass
class Detected(WrappedLikelihood):
    """Another likelihood, and detections.

    Attributes:
        likelihood: of the picture.
        found: ``[L, D]``, substates where the targets were found; NaN for one that was not.
        scale: ``[L, D]``, standard deviations of that.
    """

    likelihood: Any
    found: Any
    scale: Any

    # From ``log_prob_all``, and not the inner likelihood's own.
    log_prob = Likelihood.log_prob

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods ``[N]`` of substates ``[D, N]``."""
        of_picture = log_prob_all(self.likelihood, observation, partition, substates)
        return of_picture + self._of_detection(partition, substates)

    def _of_detection(self, partition: jax.Array, substates: jax.Array) -> jax.Array:
        found, scale = (
            jnp.asarray(values, substates.dtype)[partition].T for values in (self.found, self.scale)
        )
        was_found = jnp.all(jnp.isfinite(found), axis=0)
        off = (substates - jnp.where(was_found, found, substates)) / jnp.where(
            was_found, scale, 1.0
        )
        word = jnp.log((jnp.exp(-0.5 * jnp.sum(off**2, axis=0)) + _OTHERS) / (1 + _OTHERS))
        return jnp.where(was_found, word, 0.0)
