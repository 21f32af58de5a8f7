"""Smoothing by the genealogy: the ancestors of the last frame's particles, with its weights.

A particle's path through its ancestors is a weighted draw of the whole trajectory (Kitagawa 1996).
It needs no density of moves and serves transitions that have none.  Resampling leaves ever fewer
ancestors in earlier frames: paths coalesce, and an estimate from a handful of ancestors is poor.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.state import moments


class Traced(NamedTuple):
    """The particles of the last frame, followed back over T frames.

    Attributes:
        estimate: ``[T, P, D]``, weighted mean.
        spread: ``[T, P, D]``, weighted standard deviation.
        num_ancestors: ``[T, P]`` int32, number of distinct ancestors of nonzero weight.
        paths: ``[K, T, P, D]``, draws of trajectories.
        first: ``[P, K]`` int32, particle just before the first frame from which each path starts.
    """

    estimate: jax.Array
    spread: jax.Array
    num_ancestors: jax.Array
    paths: jax.Array
    first: jax.Array


@partial(jax.jit, static_argnames="num_paths")
def trace_back(
    key: jax.Array, current: Any, sources: Any, log_weights: jax.Array, num_paths: int
) -> Traced:
    """Follow the particles of the last frame back; with exchange, partition by partition.

    Args:
        key: a random key, for the choice of paths.
        current: ``[T, D, P, N]``, substates.
        sources: ``[T, P, N]`` int32, see ``ParticleState``.
        log_weights: ``[N]``, of the last frame.
        num_paths: K.
    """
    weights = jnp.exp(log_weights)
    ends = jax.random.categorical(key, log_weights, shape=(num_paths,))

    def step_back(index: jax.Array, item: Any) -> Any:
        current, sources = item
        values = jnp.take_along_axis(current, index[None], axis=-1)
        estimate, spread = moments(values, weights, jnp.matmul)
        rows = jnp.arange(index.shape[0])[:, None]
        present = jnp.zeros(index.shape, bool).at[rows, index].max(weights > 0)
        count = jnp.sum(present, axis=1, dtype=jnp.int32)
        before = jnp.take_along_axis(sources, index, axis=-1)
        return before, (estimate.T, spread.T, count, values[..., ends])

    slots = jnp.arange(weights.shape[0], dtype=jnp.int32)
    last = jnp.broadcast_to(slots, sources.shape[1:])
    first, (*moments_and_count, paths) = lax.scan(step_back, last, (current, sources), reverse=True)
    return Traced(*moments_and_count, jnp.transpose(paths, (3, 0, 2, 1)), first[:, ends])
