"""Figure 3: the one-target and two-target likelihoods on one measurement line."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.likelihoods.contours import (
    Features,
    detection_probabilities,
    line_weights,
    log_ratio,
    poisson_clutter,
)
from jaxpf.lowering.programs import compiled

#: Positions of four features in figure 3, read off approximately, pixels from the line's middle.
FEATURES = (-50.0, -15.0, 20.0, 55.0)
_LENGTH, _SIGMA, _CLUTTER = 161, 7.0, 2.0


def likelihood(boundaries: ArrayLike) -> np.ndarray:
    """``p~_c / p_0`` ``[...]`` of the line for boundaries ``[c, ...]``, pixels from its middle."""
    return np.asarray(_likelihood(jnp.asarray(boundaries, jnp.float32)))


def peaks() -> tuple[np.ndarray, np.ndarray]:
    """Two-target likelihood with both at one feature, ``[4]``, and at pairs of them, ``[6]``."""
    first, second = np.triu_indices(len(FEATURES), 1)
    places = np.array(FEATURES)
    together = likelihood(np.stack([places, places]))
    return together, likelihood(np.stack([places[first], places[second]]))


def ratio_of_peaks() -> float:
    """The highest peak on the diagonal over the lowest beside it."""
    together, apart = peaks()
    return float(together.max() / apart.min())


@compiled
def _likelihood(boundaries: jax.Array) -> jax.Array:
    count, shape = len(FEATURES), boundaries.shape[1:]
    places = jnp.broadcast_to(jnp.array(FEATURES).reshape(-1, *[1] * len(shape)), (count, *shape))
    features = Features(places, jnp.ones(places.shape, bool))
    weights = line_weights(
        # The distribution extends past the number of features, because a full line may have had
        # more.
        poisson_clutter(_CLUTTER, 3 * count),
        detection_probabilities(len(boundaries)),
        _LENGTH,
    )
    there = jnp.ones(boundaries.shape, bool)
    return jnp.exp(log_ratio(weights, features, boundaries, there, _SIGMA, _LENGTH / 2))
