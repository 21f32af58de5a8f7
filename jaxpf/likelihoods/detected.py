"""Combine an image likelihood with detections, allowing for false ones.

For a detected target, the image likelihood is multiplied by::

    (exp(-r^2 / 2) + c) / (1 + c),   r^2 = sum over coordinates of ((x - place) / scale)^2

where c accounts for a detection of another object, so that a wrong detection cannot drive a
target's particles away.  Targets without a detection are not affected.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract import WrappedLikelihood, log_prob_all
from jaxpf.contract.pytree import pytree_dataclass

#: c: beyond three standard deviations a detection hardly counts.
_OTHERS = 0.01


@pytree_dataclass
class Detected(WrappedLikelihood):
    """Another likelihood, multiplied by that of detections.

    Attributes:
        likelihood: of the image.
        places: ``[L, D]``, detected substates; NaN for a target without a detection.
        scale: ``[L, D]``, standard deviations of the detections.
    """

    likelihood: Any
    places: Any
    scale: Any

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods ``[N]`` of substates ``[D, N]``."""
        of_picture = log_prob_all(self.likelihood, observation, partition, substates)
        return of_picture + self._of_detection(partition, substates)

    def _of_detection(self, partition: jax.Array, substates: jax.Array) -> jax.Array:
        place, scale = (
            jnp.asarray(values, substates.dtype)[partition].T
            for values in (self.places, self.scale)
        )
        is_detected = jnp.all(jnp.isfinite(place), axis=0)
        off = (substates - jnp.where(is_detected, place, substates)) / jnp.where(
            is_detected, scale, 1.0
        )
        word = jnp.log((jnp.exp(-0.5 * jnp.sum(off**2, axis=0)) + _OTHERS) / (1 + _OTHERS))
        return jnp.where(is_detected, word, 0.0)
