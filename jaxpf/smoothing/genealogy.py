"""Smoothing by the genealogy: the ancestors of the last frame's particles, with its weights.

A particle's path through its ancestors is a weighted draw of the whole trajectory (Kitagawa 1996).
It needs no density of moves and serves transitions that have none.  Resampling leaves ever fewer
ancestors in earlier frames: paths coalesce, and an estimate from a handful of ancestors is poor.
After an exchange of parts, each partition has ancestors of its own.

Arrays are those of the filter: substates ``current`` ``[T, D, P, N]``, ``sources`` ``[T, P, N]``
int32 (see ``ParticleState``), and ``log_weights`` ``[N]`` of the last frame.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.state import moments
from jaxpf.lowering.programs import compiled


@compiled
def trace_back(
    current: jax.Array, sources: jax.Array, log_weights: jax.Array
) -> tuple[jax.Array, ...]:
    """Follow all particles of the last frame back.

    Returns:
        Weighted mean and standard deviation of the paths, ``[T, P, D]`` each, and the number of
        distinct ancestors of nonzero weight, ``[T, P]`` int32.
    """
    weights = jnp.exp(log_weights)

    def of_frame(values: jax.Array, index: jax.Array) -> tuple[jax.Array, ...]:
        estimate, spread = moments(values, weights, jnp.matmul)
        rows = jnp.arange(index.shape[0])[:, None]
        present = jnp.zeros(index.shape, bool).at[rows, index].max(weights > 0)
        return estimate.T, spread.T, jnp.sum(present, axis=1, dtype=jnp.int32)

    return _follow(jnp.arange(len(weights), dtype=jnp.int32), current, sources, of_frame)


@partial(compiled, static_argnames="num_paths")
def draw_paths(
    key: jax.Array, current: jax.Array, sources: jax.Array, log_weights: jax.Array, num_paths: int
) -> jax.Array:
    """Draw K trajectories ``[K, T, P, D]``: the paths of particles drawn by their weight."""
    ends = jax.random.categorical(key, log_weights, shape=(num_paths,)).astype(jnp.int32)
    return jnp.transpose(_follow(ends, current, sources, lambda values, _: values), (3, 0, 2, 1))


def _follow(ends: jax.Array, current: jax.Array, sources: jax.Array, of_frame: Callable) -> Any:
    """``of_frame(substates [D, P, K], particles [P, K])`` of paths to ``ends`` ``[K]``."""

    def step_back(index: jax.Array, item: Any) -> Any:
        current, sources = item
        values = jnp.take_along_axis(current, index[None], axis=-1)
        return jnp.take_along_axis(sources, index, axis=-1), of_frame(values, index)

    last = jnp.broadcast_to(ends, (sources.shape[1], len(ends)))
    return lax.scan(step_back, last, (current, sources), reverse=True)[1]
