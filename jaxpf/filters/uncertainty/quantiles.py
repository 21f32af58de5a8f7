"""Quantiles of weighted particles."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import is_concrete

if TYPE_CHECKING:
    import jax


def quantiles(
    values: "jax.Array | np.ndarray", log_weights: "jax.Array | np.ndarray", levels: Sequence[float]
) -> Any:
    """Quantiles of weighted particles: the smallest values that reach each share of the weight.

    Also inside a ``record`` of ``jaxpf.run``: ``record=lambda state, summary:
    jaxpf.filters.quantiles(state.substates, state.log_weights, [0.025, 0.975])``.

    Args:
        values: ``[N, P, C]``, such as coordinates of ``state.substates``; NaN (a particle that
            holds another target) counts as zero weight.
        log_weights: normalised, ``[N]``, or ``[P, N]`` if partitions have separate weights.
        levels: L levels from 0 to 1.

    Returns:
        ``[L, P, C]``, a NumPy array if the values are known, else traced; NaN for a
        partition without particles of any weight.

    Raises:
        InputError: a level outside of 0 to 1.
    """
    check_number("levels", levels, least=0, most=1)
    shares = np.asarray(levels, float)
    # NumPy, in float64, wherever the values are known.
    xp: Any = np if is_concrete(values, log_weights) else jnp
    values = xp.moveaxis(xp.asarray(values), 0, -1)
    if not values.shape[-1]:
        return xp.full((len(shares), *values.shape[:-1]), np.nan)
    weights = xp.exp(xp.asarray(log_weights, float))
    weights = xp.broadcast_to(weights if weights.ndim == 1 else weights[:, None], values.shape)
    weights = xp.where(xp.isnan(values), 0.0, weights)
    order = xp.argsort(values, axis=-1)
    reached = xp.cumsum(xp.take_along_axis(weights, order, axis=-1), axis=-1)
    short = [(reached < level * reached[..., -1:]) | (reached <= 0) for level in shares]
    below = [xp.sum(each, axis=-1) for each in short]
    places = xp.minimum(xp.stack(below), values.shape[-1] - 1)
    in_order = xp.take_along_axis(values, order, axis=-1)[None]
    chosen = xp.take_along_axis(in_order, places[..., None], axis=-1)
    return xp.where(reached[..., -1] > 0, chosen[..., 0], np.nan)
