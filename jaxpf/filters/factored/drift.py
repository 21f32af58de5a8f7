"""Drift: partitions move together, by correlations of their velocities (eskil2014, eq. 8 to 10).

A partition's drift combines the velocities that the other partitions seem to have in this frame,
weighted by how similarly they moved in the last frames.
"""

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import pytree_dataclass

#: The ridge's strength, as a share of the partitions' mean squared velocity.
_RIDGE = 0.1


@pytree_dataclass
class Motion:
    """Places and velocities of the partitions.

    Attributes:
        place: ``[P, E]``, the last estimates.
        velocities: ``[memory, P, E]``, displacements per frame, the latest first.
        known: ``[]`` int32, number of velocities known yet.
    """

    place: jax.Array
    velocities: jax.Array
    known: jax.Array

    def after(self, place: jax.Array) -> "Motion":
        """The same with a new estimate ``[P, E]``."""
        latest = (place - self.place)[None]
        return Motion(
            place=place,
            velocities=jnp.concatenate([latest, self.velocities[:-1]]),
            known=jnp.minimum(self.known + 1, self.velocities.shape[0]),
        )


def at_rest(place: jax.Array, memory: int) -> Motion:
    """Partitions at ``place`` ``[P, E]`` of unknown motion."""
    return Motion(
        place=place,
        velocities=jnp.zeros((memory, *place.shape), place.dtype),
        known=jnp.zeros((), jnp.int32),
    )


def drift(motion: Motion, seen: jax.Array, rule: str) -> jax.Array:
    """Each partition's drift, ``[P, E]`` (eskil2014, eq. 10).

    Args:
        motion: of the frames before.
        seen: ``[P, E]``, the velocities that the partitions seem to have now.
        rule: ``"clip"``: correlations below 0 count as 0, and weights sum to one; ``"signed"``:
            weights are divided by the sum of their sizes, so that opposite motion pushes back;
            ``"literal"``: by their plain sum, as eq. 9 has it, which explodes where correlations
            cancel;
            ``"ridge"``: the best linear prediction of a partition's velocity by the others'
            (ridge regression on the frames remembered).  Where a partition's motion is unknown,
            the others count equally.
    """
    if rule == "none":
        return jnp.zeros_like(seen)
    mean, centred = _centred(motion)
    if rule == "ridge":
        return _predicted(motion, mean, centred, seen)
    return weights(motion, rule) @ seen


def weights(motion: Motion, rule: str) -> jax.Array:
    """rho ``[P, P]`` of all rules but ``"ridge"``, zero on the diagonal (eq. 8 and 9)."""
    related = correlations(motion)
    num_partitions = related.shape[0]
    if rule == "clip":
        related = jnp.maximum(related, 0.0)
    summed = related if rule == "literal" else jnp.abs(related)
    total = jnp.sum(summed, axis=1, keepdims=True)
    alike = _others(num_partitions, related.dtype) / (num_partitions - 1)
    enough = jnp.abs(total) > 1e-6
    return jnp.where(enough, related / jnp.where(enough, total, 1.0), alike)


def correlations(motion: Motion) -> jax.Array:
    """Correlations ``[P, P]`` of the velocities; 0 on the diagonal, and where nothing moved."""
    _, centred = _centred(motion)
    products = jnp.einsum("tie,tje->ij", centred, centred)
    squares = jnp.diagonal(products)
    # An exact zero, and what rounding makes of one.
    moves = squares > 1e-12 * (1.0 + jnp.max(squares))
    scale = jnp.where(moves, jax.lax.rsqrt(jnp.where(moves, squares, 1.0)), 0.0)
    related = products * scale[:, None] * scale[None, :]
    return related * _others(related.shape[0], related.dtype)


def _centred(motion: Motion) -> tuple[jax.Array, jax.Array]:
    """Mean velocity ``[P, E]`` of the frames known, and what differs from it; else zeros."""
    steps = jnp.arange(motion.velocities.shape[0])[:, None, None]
    known = steps < motion.known
    number = jnp.maximum(motion.known, 1).astype(motion.velocities.dtype)
    mean = jnp.sum(jnp.where(known, motion.velocities, 0.0), axis=0) / number
    return mean, jnp.where(known, motion.velocities - mean, 0.0)


def _predicted(motion, mean, centred, seen):
    """Ridge regression of every partition's velocity on the others', all P at once.

    The coefficients of row i are ``-A_ij / A_ii``, A the inverse of the regularised products.
    """
    products = jnp.einsum("tie,tje->ij", centred, centred)
    num_partitions = products.shape[0]
    # Without any motion yet, all are regularised alike and predict nothing.
    strength = _RIDGE * jnp.trace(products) / num_partitions + 1e-6
    inverse = jnp.linalg.inv(products + strength * jnp.eye(num_partitions, dtype=products.dtype))
    share = -inverse / jnp.diagonal(inverse)[:, None] * _others(num_partitions, inverse.dtype)
    alike = _others(num_partitions, seen.dtype) / (num_partitions - 1)
    return jnp.where(motion.known > 1, mean + share @ (seen - mean), alike @ seen)


def _others(num_partitions: int, dtype) -> jax.Array:
    return 1.0 - jnp.eye(num_partitions, dtype=dtype)
