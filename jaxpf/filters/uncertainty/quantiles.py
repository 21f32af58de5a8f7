"""Quantiles of weighted particles."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.contract.numbers import check_array


def quantiles(values: Any, log_weights: Any, levels: Sequence[float]) -> np.ndarray:
    """Quantiles of weighted particles: the smallest values that reach each share of the weight.

    Args:
        values: ``[N, P, C]``, such as coordinates of ``state.substates``; NaN (a particle that
            holds another target) counts as zero weight.
        log_weights: normalised, ``[N]``, or ``[P, N]`` if partitions have separate weights.
        levels: L levels from 0 to 1.

    Returns:
        ``[L, P, C]``; NaN for a partition without particles of any weight.

    Raises:
        InputError: no level, or one outside of 0 to 1.
    """
    check_array("levels", levels, "a list of numbers from 0 to 1, [>= 1]", least=0, most=1)
    shares = np.asarray(levels, float)
    check_array("values", values, "coordinates of the particles, [N, P, C]")
    check_array("log_weights", log_weights, f"of the particles, [..., {np.shape(values)[0]}]")
    values = np.moveaxis(np.asarray(values), 0, -1)
    if not values.shape[-1]:
        return np.full((len(shares), *values.shape[:-1]), np.nan)
    weights = np.exp(np.asarray(log_weights, np.float64))
    weights = np.broadcast_to(weights if weights.ndim == 1 else weights[:, None], values.shape)
    weights = np.where(np.isnan(values), 0.0, weights)
    order = np.argsort(values, axis=-1)
    reached = np.cumsum(np.take_along_axis(weights, order, axis=-1), axis=-1)
    below = [np.sum(reached < level * reached[..., -1:], axis=-1) for level in shares]
    places = np.minimum(below, values.shape[-1] - 1)
    chosen = np.take_along_axis(np.take_along_axis(values, order, -1)[None], places[..., None], -1)
    return np.where(reached[..., -1] > 0, chosen[..., 0], np.nan)
