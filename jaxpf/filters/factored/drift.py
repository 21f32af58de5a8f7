"""Drift: partitions move together, by correlations of their velocities (eskil2014, eq. 8 to 10).

A partition's drift is a weighted sum of the other partitions' apparent velocities in this frame,
with weights from the correlations of their motion over the last frames.
"""

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import pytree_dataclass

#: Strength of the ridge penalty, as a share of the partitions' mean squared velocity.
_RIDGE = 0.1


@pytree_dataclass
class Motion:
    """Positions and past velocities of the partitions.

    Attributes:
        place: ``[P, E]``, the last estimates.
        velocities: ``[memory, P, E]``, displacements per frame, latest first.
        num_recorded: ``[]`` int32, number of velocities recorded.
    """

    place: jax.Array
    velocities: jax.Array
    num_recorded: jax.Array

    def after(self, place: jax.Array) -> "Motion":
        """Add a new estimate ``[P, E]``."""
        latest = (place - self.place)[None]
        return Motion(
            place=place,
            velocities=jnp.concatenate([latest, self.velocities[:-1]]),
            num_recorded=jnp.minimum(self.num_recorded + 1, self.velocities.shape[0]),
        )


def at_rest(place: jax.Array, memory: int) -> Motion:
    """Partitions at ``place`` ``[P, E]`` with no recorded velocities."""
    return Motion(
        place=place,
        velocities=jnp.zeros((memory, *place.shape), place.dtype),
        num_recorded=jnp.zeros((), jnp.int32),
    )


def drift(motion: Motion, seen: jax.Array, rule: str) -> jax.Array:
    """Each partition's drift, ``[P, E]`` (eskil2014, eq. 10).

    Args:
        motion: motion in the previous frames.
        seen: ``[P, E]``, the partitions' apparent velocities in this frame.
        rule: ``"clip"`` sets correlations below 0 to 0 and normalises weights to sum to one.
            ``"signed"`` divides weights by the sum of their absolute values, so opposite motion
            pushes back.  ``"literal"`` divides by their plain sum, as in eq. 9, which explodes if
            correlations cancel.  ``"ridge"`` is the best linear prediction of a partition's
            velocity from the others' (ridge regression on the remembered frames).  If a partition's
            motion is unknown, the others count equally.
    """
    if rule == "none":
        return jnp.zeros_like(seen)
    mean, centred = _centred(motion)
    if rule == "ridge":
        return _predicted(motion, mean, centred, seen)
    return weights(motion, rule) @ seen


def weights(motion: Motion, rule: str) -> jax.Array:
    """rho ``[P, P]`` for all rules except ``"ridge"``, zero on the diagonal (eq. 8 and 9)."""
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
    """Correlations ``[P, P]`` of the velocities; 0 on the diagonal and without motion."""
    _, centred = _centred(motion)
    products = jnp.einsum("tie,tje->ij", centred, centred)
    squares = jnp.diagonal(products)
    # Treat rounding errors of zero as zero.
    moves = squares > 1e-12 * (1.0 + jnp.max(squares))
    scale = jnp.where(moves, jax.lax.rsqrt(jnp.where(moves, squares, 1.0)), 0.0)
    related = products * scale[:, None] * scale[None, :]
    return related * _others(related.shape[0], related.dtype)


def _centred(motion: Motion) -> tuple[jax.Array, jax.Array]:
    """Mean velocity ``[P, E]`` over the recorded frames, and deviations from it, else zeros."""
    steps = jnp.arange(motion.velocities.shape[0])[:, None, None]
    is_recorded = steps < motion.num_recorded
    number = jnp.maximum(motion.num_recorded, 1).astype(motion.velocities.dtype)
    mean = jnp.sum(jnp.where(is_recorded, motion.velocities, 0.0), axis=0) / number
    return mean, jnp.where(is_recorded, motion.velocities - mean, 0.0)


def _predicted(motion, mean, centred, seen):
    """Ridge regression of each partition's velocity on the others', all P at once.

    The coefficients of row i are ``-A_ij / A_ii``, with A the inverse of the regularised products.
    """
    products = jnp.einsum("tie,tje->ij", centred, centred)
    num_partitions = products.shape[0]
    # The constant keeps the matrix invertible before any motion; coefficients are then 0.
    strength = _RIDGE * jnp.trace(products) / num_partitions + 1e-6
    inverse = jnp.linalg.inv(products + strength * jnp.eye(num_partitions, dtype=products.dtype))
    share = -inverse / jnp.diagonal(inverse)[:, None] * _others(num_partitions, inverse.dtype)
    alike = _others(num_partitions, seen.dtype) / (num_partitions - 1)
    return jnp.where(motion.num_recorded > 1, mean + share @ (seen - mean), alike @ seen)


def _others(num_partitions: int, dtype) -> jax.Array:
    return 1.0 - jnp.eye(num_partitions, dtype=dtype)
