"""What the backward passes over a filter's weighted sets share: what to keep, and keys."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.state import ParticleState, Summary
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.lowering.programs import compiled
from jaxpf.smoothing.backward import History, Pass, backward
from jaxpf.smoothing.groups import together

#: Index of the key for backward passes; frames use indices from 0.
_BACKWARD = np.uint32(2**32 - 1)


def keep_substates(state: ParticleState, summary: Summary) -> tuple:
    """Record a frame's weighted set and its summary."""
    return History(state.lagged[0], None, state.log_weights, state.label, state.sources), summary


def keep_both_lags(state: ParticleState, summary: Summary) -> tuple:
    """Record the substates of the previous frame too, for second-order motion."""
    history, summary = keep_substates(state, summary)
    return history._replace(previous=state.lagged[1]), summary


def backward_key(key: jax.Array) -> jax.Array:
    """Derive the key for drawing trajectories from a run's key."""
    return jax.random.fold_in(key, _BACKWARD)


@partial(compiled, static_argnames=("num_trajectories", "num_paths", "num_steps"))
def _backward_groups(
    tracker, keys, history, parts, parents, num_trajectories, num_paths, first, num_steps
):
    """Run backward passes in sequence over groups of the same size, ``[Q, G]``."""

    def of_group(group):
        key, parts, parents = group
        sizes = num_trajectories, num_paths
        return backward(tracker, key, history, parts, parents, *sizes, first, num_steps)

    return lax.map(of_group, (keys, parts, parents))


def back_over(tracker, key, history, num_trajectories, num_paths=0, first=0, num_steps=0) -> Pass:
    """Smooth all partitions and join the passes: ``[T, P, D]``, paths ``[K, T, P, D]``."""
    results, order = [], []
    for number, (parts, parents) in enumerate(together(tracker)):
        keys = jax.random.split(jax.random.fold_in(key, number), len(parts))
        sizes = num_trajectories, num_paths, first, num_steps
        results.append(_backward_groups(tracker, keys, history, parts, parents, *sizes))
        order.append(parts.reshape(-1))
    back = np.argsort(np.concatenate(order))

    def assembled(name: str) -> jax.Array:
        # [Q, T, ..., D, G] of every size: concatenate the groups' partitions in original order.
        by_size = [jnp.moveaxis(getattr(result, name), 0, -2) for result in results]
        flat = [x.reshape(*x.shape[:-2], x.shape[-2] * x.shape[-1]) for x in by_size]
        return jnp.swapaxes(jnp.concatenate(flat, axis=-1)[..., back], -1, -2)

    return Pass(
        estimate=assembled("estimate"),
        spread=assembled("spread"),
        paths=jnp.swapaxes(assembled("paths"), 0, 1),
        broken=jnp.sum(jnp.stack([jnp.sum(result.broken) for result in results])),
    )


def checked_number(tracker: Partitioned, num_trajectories: int | None, num_paths: int = 0) -> int:
    """Return the number of trajectories; refuse fewer than one, and fewer than paths."""
    if num_trajectories is None:
        return max(tracker.num_particles, num_paths)
    check_whole("num_trajectories", num_trajectories)
    if num_paths > num_trajectories:
        raise InputError(
            f"paths={num_paths} are more than num_trajectories={num_trajectories}; draw as many."
        )
    return num_trajectories
