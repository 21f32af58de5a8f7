"""Measures of particle sets and of articulated poses, as pure functions of arrays."""

import jax.numpy as jnp
from jax import Array
from jax.scipy.special import logsumexp
from jax.typing import ArrayLike

from jaxpf.measures.metrics import as_float


def effective_dynamics(spread: ArrayLike, scale: ArrayLike) -> Array:
    """Spread of the particles relative to the process noise, a ratio of standard deviations.

    smith2004 defines it as a variance but plots it as a percentage of sigma.  It can exceed 1,
    because particles follow the observations and their spread carries over between frames.
    ``spread`` is ``[..., P, D]``, at the end of a time step; ``scale``, sigma, ``[D]`` or
    ``[P, D]``.  NaN in coordinates without process noise.
    """
    spread, scale = as_float(spread), as_float(scale)
    has_noise = scale > 0
    return jnp.where(has_noise, spread / jnp.where(has_noise, scale, 1), jnp.nan)


def corner_distances(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """Sum of the distances between the 4 P corners of estimated and true rectangles, in pixels.

    Source: gonzales2011, section 4, "the sum of the Euclidean distances between the corners".
    Corners are ``[..., P, 4, 2]``, see ``jaxpf.shapes.rectangles.corners_from_poses``; NaN if any
    is not finite.
    """
    apart = as_float(estimate) - as_float(truth)
    distance = jnp.hypot(apart[..., 0], apart[..., 1])
    total = jnp.sum(distance, axis=(-2, -1))
    return jnp.where(jnp.isfinite(total), total, jnp.nan)


def pose_variance(spread: ArrayLike, sizes: ArrayLike) -> Array:
    """Variance of a particle set over the poses of P rectangles, in square pixels.

    gonzales2011 plots "the variance of the particle set" without a definition.  Here it is the
    mean squared distance of a rectangle's corners from their mean positions, to first order in
    the angle, summed over the rectangles: var x + var y + r^2 var theta with r half the diagonal.
    The factor r^2 makes pixels and radians commensurable.  ``spread`` is ``[..., P, >= 3]``, of x,
    y, theta; ``sizes`` ``[P, 2]``.  NaN if a spread is not finite.
    """
    spread, sizes = as_float(spread), as_float(sizes)
    radius = 0.5 * jnp.hypot(sizes[..., 0], sizes[..., 1])
    levers = jnp.stack([jnp.ones_like(radius), jnp.ones_like(radius), radius], axis=-1)
    total = jnp.sum((spread[..., :3] * levers) ** 2, axis=(-2, -1))
    return jnp.where(jnp.isfinite(total), total, jnp.nan)


def resamplings_per_frame(resample_after: ArrayLike) -> Array:
    """Resamplings of the whole set per frame, with that at the start.

    P for PS, the number of levels for SPS; of ``Ordering.resample_after``.
    """
    return 1 + jnp.sum(jnp.asarray(resample_after), axis=-1)


def effective_sample_size(log_weights: ArrayLike) -> Array:
    """Effective sample size (sum w)^2 / sum w^2, or 1 / sum w^2 for normalised weights.

    Source: maccormick1999, Kong et al. 1994.

    Args:
        log_weights: ``[..., N]``, normalised or not; values that are not finite count as weight 0.

    Returns:
        ``[...]``, from 1 to N, or 0 if all weights are 0.
    """
    log_weights = as_float(log_weights)
    log_weights = jnp.where(jnp.isfinite(log_weights), log_weights, -jnp.inf)
    largest = jnp.max(log_weights, axis=-1, keepdims=True)
    # Relative to the largest weight, so that neither sum overflows or underflows.
    relative = log_weights - jnp.where(jnp.isfinite(largest), largest, 0)
    size = jnp.exp(2 * logsumexp(relative, axis=-1) - logsumexp(2 * relative, axis=-1))
    return jnp.where(jnp.isfinite(largest[..., 0]), size, 0)
