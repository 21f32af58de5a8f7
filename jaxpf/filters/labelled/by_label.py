"""Sums, maxima and log-sums over the particles of each label.

Labels ``[N]`` may be in any order.  For very few labels, a product with a one-hot table vectorises;
for more, scatters are faster.  With 10 labels, a frame of a 1-D model takes 100 ns per particle
with the table and 74 ns with scatters (CPU).
"""

import jax
import jax.numpy as jnp
from jax import lax

#: Up to this number of labels, use the one-hot table.
FEW = 4


def broadcast(values: jax.Array, labels: jax.Array) -> jax.Array:
    """Each particle's entry of ``values`` ``[..., L]``: ``[..., N]``."""
    if values.shape[-1] == 1:
        return jnp.broadcast_to(values, (*values.shape[:-1], labels.shape[0]))
    return values[..., labels]


def sums(values: jax.Array, labels: jax.Array, num_labels: int) -> jax.Array:
    """``[K, L]``: sums of finite ``values`` ``[K, N]`` over the particles of each label."""
    if num_labels <= FEW:
        return values @ _table(labels, num_labels).astype(values.dtype)
    zeros = jnp.zeros((num_labels, values.shape[0]), values.dtype)
    return zeros.at[labels].add(values.T).T


def maxima(values: jax.Array, labels: jax.Array, num_labels: int) -> jax.Array:
    """``[L]``: the largest of ``values`` ``[N]`` per label; -inf if none.  Not differentiable."""
    values = lax.stop_gradient(values)
    if num_labels == 1:
        return jnp.max(values)[None]
    if num_labels <= FEW:
        return jnp.max(jnp.where(_table(labels, num_labels).T, values, -jnp.inf), axis=1)
    return jnp.full((num_labels,), -jnp.inf, values.dtype).at[labels].max(values)


def counts(labels: jax.Array, num_labels: int) -> jax.Array:
    """``[L]`` int32: number of particles with each label."""
    if num_labels <= FEW:
        return jnp.sum(_table(labels, num_labels), axis=0, dtype=jnp.int32)
    return jnp.zeros((num_labels,), jnp.int32).at[labels].add(1)


def log_sums(values: jax.Array, labels: jax.Array, num_labels: int) -> jax.Array:
    """``[L]``: log of the sum of ``exp(values)`` ``[N]``; -inf for an empty sum."""
    largest = maxima(values, labels, num_labels)
    alive = ~jnp.isneginf(largest)
    reference = broadcast(jnp.where(alive, largest, 0.0), labels)
    possible = ~jnp.isneginf(values)
    # Both branches must stay finite: NaN would reach the derivative.
    relative = jnp.where(possible, values - reference, 0.0)
    scaled = jnp.where(possible, jnp.exp(relative), 0.0)
    total = sums(scaled[None], labels, num_labels)[0]
    return jnp.where(alive, largest + jnp.log(jnp.where(alive, total, 1.0)), -jnp.inf)


def _table(labels: jax.Array, num_labels: int) -> jax.Array:
    """One-hot table of the labels, ``[N, L]`` bool."""
    return labels[:, None] == jnp.arange(num_labels, dtype=labels.dtype)
