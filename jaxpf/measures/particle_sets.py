"""Measures of particle sets and of articulated poses, as pure functions of arrays."""

import jax.numpy as jnp
from jax import Array
from jax.scipy.special import logsumexp
from jax.typing import ArrayLike

from jaxpf.measures.means import as_float


def effective_dynamics(spread: ArrayLike, scale: ArrayLike) -> Array:
    """Spread of the particles relative to the process noise, a ratio of standard deviations.

    smith2004 defines it as a variance but plots it as a percentage of sigma.  It can exceed 1,
    because particles follow the observations and their spread carries over between frames.

    Args:
        spread: ``[..., P, D]`` standard deviations of the particle set at the end of a time step.
        scale: ``[D]`` or ``[P, D]``, sigma, the standard deviation of the process noise.

    Returns:
        ``[..., P, D]``; NaN in coordinates without process noise.
    """
    spread, scale = as_float(spread), as_float(scale)
    has_noise = scale > 0
    return jnp.where(has_noise, spread / jnp.where(has_noise, scale, 1), jnp.nan)


def corner_distances(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """Sum of the distances between the corners of estimated and true rectangles.

    Source: gonzales2011, section 4, "the sum of the Euclidean distances between the corners".

    Args:
        estimate: ``[..., P, 4, 2]`` corners in pixels, see
            ``jaxpf.shapes.rectangles.corners_from_poses``.
        truth: ``[..., P, 4, 2]``; the leading axes broadcast.

    Returns:
        ``[...]``, the sum over all 4 P corners, in pixels; NaN if any corner of either is not
        finite.
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
    The factor r^2 makes pixels and radians commensurable.

    Args:
        spread: ``[..., P, D]``, D >= 3, standard deviations of x, y, theta; others are ignored.
        sizes: ``[P, 2]`` width and height, pixels.

    Returns:
        ``[...]``; NaN if a spread is not finite.
    """
    spread, sizes = as_float(spread), as_float(sizes)
    radius = 0.5 * jnp.hypot(sizes[..., 0], sizes[..., 1])
    levers = jnp.stack([jnp.ones_like(radius), jnp.ones_like(radius), radius], axis=-1)
    total = jnp.sum((spread[..., :3] * levers) ** 2, axis=(-2, -1))
    return jnp.where(jnp.isfinite(total), total, jnp.nan)


def resamplings_per_frame(resample_after: ArrayLike) -> Array:
    """Resamplings of the whole set per frame: P for PS, the number of levels for SPS.

    Args:
        resample_after: ``[..., P]`` bool, ``Ordering.resample_after``.

    Returns:
        ``[...]`` int, including the resampling at the start of the frame.
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


def distinct_share(lineage: ArrayLike) -> Array:
    """U / N: share of distinct particles, which smith2004 calls uniqueness.

    Args:
        lineage: ``[..., P, N]`` int, lineage id of each particle's partition; copies share it.

    Returns:
        ``[..., P]``, from 1 / N to 1.
    """
    ordered = jnp.sort(jnp.asarray(lineage), axis=-1)
    changes = jnp.sum(ordered[..., 1:] != ordered[..., :-1], axis=-1)
    return (1 + changes) / ordered.shape[-1]
