"""Shape: a potential on the distances between partitions (eskil2014, eq. 11).

The paper calls it a proposal function, but uses it as a weight: a product of spring potentials
between a particle and this frame's estimates of the other partitions.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete


def distances(first: jax.Array, second: jax.Array) -> jax.Array:
    """Distances ``[P, Q, ...]`` of ``[E, P, ...]`` from ``[E, Q]``; finite gradients at zero."""
    apart = first[:, :, None] - second.reshape(*second.shape, *(1,) * (first.ndim - 2))[:, None]
    squares = jnp.sum(apart**2, axis=0)
    positive = squares > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, squares, 1.0)), 0.0)


def log_shape(places, centres, reference, scale, shape: str) -> jax.Array:
    """Log of the shape function, ``[P, N]`` (eskil2014, eq. 11).

    Args:
        places: ``[E, P, N]``, positions of the particles.
        centres: ``[E, P]``, estimated positions of the partitions, x_j.
        reference: ``[P, P]``, initial distances of the partitions, d_ij.
        scale: sigma_p, a share of each distance or in pixels.
        shape: ``"relative"``: ``(|x_i - x_j| / d_ij - 1) / sigma_p``; ``"pixels"``, the literal
            rule: ``(|x_i - x_j| - d_ij) / sigma_p``.  With the published sigma_p = .01 the literal
            rule leaves one particle per partition.
    """
    away = distances(places, centres) - reference[..., None]
    others = 1.0 - jnp.eye(reference.shape[0], dtype=places.dtype)
    if shape == "relative":
        away = away / jnp.where(reference > 0, reference, 1.0)[..., None]
        others = others * (reference > 0)
    strain = away / jnp.asarray(scale, places.dtype)
    return -jnp.sum(strain**2 * others[..., None], axis=1)


def reference_distances(places) -> jax.Array:
    """``[P, P]`` distances between partitions at ``places`` ``[P, E]``, which must differ."""
    if is_concrete(places):
        points = np.asarray(places)
        with np.errstate(over="ignore", invalid="ignore"):
            apart = np.linalg.norm(points[:, None] - points[None], axis=-1) + np.eye(len(points))
        first, second = np.unravel_index(np.argmin(apart), apart.shape)
        if not np.isfinite(apart).all():
            raise InputError(
                "the positions of the partitions that define the shape are not finite, or too far "
                "apart for 32 bits; give finite pixels, or use shape='none'."
            )
        if not apart[first, second] > 0:
            raise InputError(
                f"partitions {first} and {second} start at the same place, "
                f"{points[first].tolist()}: a shape needs distances; move one of them, or use "
                "shape='none'."
            )
    places = jnp.asarray(places)
    return distances(places.T, places.T)
