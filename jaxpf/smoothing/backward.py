"""Back over a filter's weighted sets, from the last frame to the first.

*Backward simulation* draws trajectories (Godsill et al. 2004).

At the last frame a particle is drawn by its weight, at each earlier frame by its weight times the
density of the move to the substates already drawn.  For second-order motion, a particle
(x_t, x_{t-1}) is drawn by ::

    w_t f(x_{t+1} | x_t, x_{t-1}) f(x_{t+2} | x_{t+1}, x_t)

and x_{t-1} is then discarded: keeping it would leave only its own ancestor as a choice at the
previous frame.  At the second-to-last frame there is no second factor.

If the likelihood depends on x_{t-1} too, its factor g(y_{t+1} | x_{t+1}, x_t) joins the weights.

The cost is quadratic: each of M trajectories evaluates all N particles of every frame.  With a few
Metropolis steps instead it is linear (Bunch & Godsill 2013): a particle is proposed by its weight
and accepted by the ratio of the two densities.  Starting from the filter's own ancestor of the
substates drawn, which follows the right law already, the steps leave this law as it is and only
renew paths that would coalesce (Dau & Chopin 2023).

Objects that are independent given the frames are smoothed separately: the distribution is the same
at lower variance, since no particle has to explain all objects at once.  Parts of one tree are
smoothed together: given only its parent's current value, a part still depends on the parent's past
(a pass per part was biased, z = 10.6 where the joint pass had 2.3).

The *genealogy* traces the ancestors of the last frame's particles.  A particle's path through them
is a weighted draw of the whole trajectory (Kitagawa 1996).  It needs no density of moves and serves
transitions that have none.  Resampling leaves ever fewer ancestors in earlier frames: paths
coalesce, and an estimate from a handful of ancestors is poor.  After an exchange of parts, each
partition has ancestors of its own.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import optional
from jaxpf.contract.logs import finite
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.state import ParticleState, Summary, moments, sanitised
from jaxpf.contract.types import TrackerLike
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.lowering import platform
from jaxpf.lowering.prefix import running_sum
from jaxpf.lowering.programs import compiled
from jaxpf.running import missing_frames

#: Array size in a pass over particles and trajectories: fits into a core's cache, or a small part
#: of an accelerator's memory.
_CHUNK, _CHUNK_ON_ACCELERATOR = 2**17, 2**26
#: Index of the key for backward passes; frames use indices from 0.
_BACKWARD = np.uint32(2**32 - 1)


class History(NamedTuple):
    """The weighted sets of T frames.

    Attributes:
        current: ``[T, D, P, N]``.
        previous: ``[T, D, P, N]``, substates of the previous frame; None for first-order motion.
        log_weights: ``[T, N]``.
        label: ``[T, N]`` int32; None if particles carry no labels.
        sources: ``[T, P, N]`` int32, ancestors, see ``ParticleState``; None if not kept.
    """

    current: jax.Array
    previous: jax.Array | None
    log_weights: jax.Array
    label: jax.Array | None
    sources: jax.Array | None = None


def keep_substates(state: ParticleState, summary: Summary) -> tuple:
    """Record a frame's weighted set and its summary."""
    return History(state.lagged[0], None, state.log_weights, state.label, state.sources), summary


def keep_both_lags(state: ParticleState, summary: Summary) -> tuple:
    """Record the substates of the previous frame too, for second-order motion."""
    history, summary = keep_substates(state, summary)
    return history._replace(previous=state.lagged[1]), summary


def key_of(key: jax.Array) -> jax.Array:
    """Derive the key for drawing trajectories from a run's key."""
    return jax.random.fold_in(key, _BACKWARD)


class Drawn(NamedTuple):
    """A trajectory's substates in the next two frames.

    For M trajectories there is a leading axis; ``log_densities`` also takes one on the right.

    Attributes:
        next: ``[D, G]``, the substates of the next frame.
        after: ``[D, G]``, the substates of the frame after it; None for first-order motion.
        label: ``[]``, label in the next frame; None without labels.
    """

    next: jax.Array
    after: jax.Array | None
    label: jax.Array | None


class Pass(NamedTuple):
    """Result of the backward pass over a group of G partitions.

    Attributes:
        estimate: ``[T, D, G]``, mean of the trajectories.
        spread: ``[T, D, G]``, their standard deviation.
        paths: ``[T, K, D, G]``, the first K trajectories.
        broken: ``[]`` int32, number of moves with zero density from every particle tried.
    """

    estimate: jax.Array
    spread: jax.Array
    paths: jax.Array
    broken: jax.Array


@pytree_dataclass
class SeenMoves(contract.DynamicsWithDensity):
    """Transition density times the likelihood of the frame that the move leads to.

    Substates are ``[x, previous]``, ``[2 D]``.

    Attributes:
        dynamics: density of x given the substate before.
        likelihood: likelihood of ``[x, previous]``, for missing frames too.
        observations: ``[T, ...]``.
        time: number of the frame that the move leads to.
    """

    dynamics: Any
    likelihood: Any
    observations: Any
    time: Any = 0

    @classmethod
    def of(cls, tracker: TrackerLike, frames: Any) -> "SeenMoves":
        """Take dynamics and likelihood from what ``missing_frames.marked`` returns."""
        model = missing_frames.unmarked(tracker)
        likelihood = model.likelihood
        if tracker is not model:
            likelihood = missing_frames.LikelihoodWithGaps(likelihood)
        return cls(model.dynamics, likelihood, lax.map(likelihood.observe, frames))

    def at_frame(self, time):
        """Return the dynamics that lead to a frame."""
        return dataclasses.replace(self, time=time)

    def log_density_all(self, partition, new, current, previous, parent):
        """Log-densities ``[N]`` of moves, and of the frame given both ends."""
        half = new.shape[0] // 2
        dynamics, likelihood = (
            calls.of_frame(part, self.time) for part in (self.dynamics, self.likelihood)
        )
        observation = calls.frame_of(self.observations, self.time)
        ends = jnp.concatenate([new[:half], current[:half]])
        log_prob = contract.log_prob_all(likelihood, observation, partition, ends)
        largest = finite(jnp.max(sanitised(log_prob)[0]))  # common to all: it changes no draw
        log_density = contract.log_density_all(dynamics, partition, new, current, previous, parent)
        return log_density + (log_prob - largest)


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
    for number, (parts, parents) in enumerate(groups_of(tracker)):
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


def groups_of(tracker: Partitioned) -> list[tuple[np.ndarray, np.ndarray]]:
    """Group the partitions by backward pass, and stack groups of the same size.

    Returns:
        For each group size G: the partitions ``[Q, G]`` of its Q groups, and the index in the group
        of each partition's parent, -1 for a root.
    """
    parents = tracker.parents
    joint = (
        calls.has_log_joint(tracker.likelihood)
        or tracker.initial_label is not None
        or (callable(tracker.initial) and not optional(tracker.initial, "independent"))
    )
    groups: dict[int, list[int]] = {}
    for part in range(len(parents)):
        root = part
        while parents[root] >= 0:
            root = parents[root]
        groups.setdefault(0 if joint else root, []).append(part)
    stacked: dict[int, list[list[int]]] = {}
    for group in groups.values():
        stacked.setdefault(len(group), []).append(group)

    def places(group: list[int]) -> list[int]:
        return [group.index(parents[part]) if parents[part] >= 0 else -1 for part in group]

    return [
        (np.array(of_size, np.int32), np.array([places(group) for group in of_size], np.int32))
        for of_size in stacked.values()
    ]


def backward(
    tracker: Partitioned,
    key: jax.Array,
    history: History,
    parts: jax.Array,
    parents: jax.Array,
    num_trajectories: int,
    num_paths: int,
    first: ArrayLike = 0,
    num_steps: int = 0,
) -> Pass:
    """Draw trajectories of one group of partitions.

    Args:
        tracker: the tracker whose dynamics moved the particles.
        key: a random key.
        history: weighted sets of all partitions.
        parts: ``[G]`` int32, partitions of the group.
        parents: ``[G]`` int32, index in the group of each partition's parent, -1 for a root.
        num_trajectories: M.
        num_paths: K, number of trajectories to return.
        first: number of the history's first frame.
        num_steps: number of Metropolis steps per frame; 0 draws exactly.
    """
    num_frames = history.log_weights.shape[0]
    dimension, dtype = history.current.shape[1], history.current.dtype
    whole = jnp.zeros((num_trajectories, dimension, parts.shape[0]), dtype)
    start = Drawn(
        next=whole,
        after=None if history.previous is None else whole,
        label=None if history.label is None else jnp.zeros((num_trajectories,), jnp.int32),
    )
    most = _CHUNK_ON_ACCELERATOR if platform.on_accelerator() else _CHUNK
    chunk = max(1, most // (parts.shape[0] * history.log_weights.shape[1]))

    def step_back(carry: tuple[Drawn, jax.Array], item: Any) -> Any:
        drawn, origin = carry
        (current, previous, log_weights, label, sources), time, key = item
        here = History(
            current[:, parts], None if previous is None else previous[:, parts], log_weights, label
        )
        frames_left = num_frames - 1 - time

        def draw(drawn_and_noise: tuple[Drawn, jax.Array]) -> tuple[jax.Array, jax.Array]:
            log_moves = log_densities(
                tracker, here, drawn_and_noise[0], parts, parents, frames_left, first + time
            )
            possible = jnp.isfinite(log_moves) & ~jnp.isneginf(log_weights)
            broken = ~jnp.any(possible)
            by_move = jnp.where(possible, log_weights + log_moves, -jnp.inf)
            return _pick(drawn_and_noise[1], jnp.where(broken, log_weights, by_move)), broken

        def log_moves_from(index: jax.Array) -> jax.Array:
            chosen = jax.tree.map(lambda x: x[..., index], here)
            last = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), drawn)
            log_moves = log_densities(
                tracker, chosen, last, parts, parents, frames_left, first + time
            )
            return jnp.where(jnp.isfinite(log_moves), log_moves, -jnp.inf)

        if num_steps:
            index, broken = _metropolis(key, log_weights, log_moves_from, origin, num_steps)
            origin = sources[parts[0], index]
        else:
            uniforms = jax.random.uniform(key, (num_trajectories,), dtype)
            index, broken = lax.map(
                draw, (drawn, uniforms), batch_size=min(chunk, num_trajectories)
            )
        chosen = jnp.moveaxis(here.current[:, :, index], -1, 0)  # [M, D, G]
        drawn = Drawn(
            next=chosen,
            after=None if drawn.after is None else drawn.next,
            label=None if label is None else label[index],
        )
        shares = jnp.full(len(chosen), 1 / len(chosen), chosen.dtype)
        estimate, spread = moments(jnp.moveaxis(chosen, 0, -1), shares, jnp.matmul)
        broken = jnp.sum(broken, dtype=jnp.int32)
        return (drawn, origin), (estimate, spread, chosen[:num_paths], broken)

    items = history, jnp.arange(num_frames), jax.random.split(key, num_frames)
    origin = jnp.zeros((num_trajectories,), jnp.int32)
    moments_and_paths = lax.scan(step_back, (start, origin), items, reverse=True)[1]
    estimate, spread, paths, broken = moments_and_paths
    if num_steps:  # parts of one particle with several ancestors have no one to start from
        of_parts = jnp.asarray(history.sources)[:, parts]
        one = jnp.all(of_parts == of_parts[:, :1])
        estimate = jnp.where(one, estimate, jnp.nan)
    return Pass(estimate, spread, paths, jnp.sum(broken))


def log_densities(
    tracker: Partitioned,
    here: History,
    drawn: Drawn,
    parts: jax.Array,
    parents: jax.Array,
    frames_left: jax.Array,
    time: ArrayLike,
) -> jax.Array:
    """Log-densities ``[N]`` of a trajectory's next moves from every particle of a frame.

    Args:
        tracker: the tracker whose dynamics moved the particles.
        here: the frame's weighted set, with substates ``[D, G, N]``.
        drawn: one trajectory; or one for each particle, with a last axis ``[N]``.
        parts: see ``backward``.
        parents: see ``backward``.
        frames_left: ``[]``, number of frames after this one.
        time: the frame's number, for dynamics that change with time.
    """
    num_particles = here.log_weights.shape[0]
    to_next, to_after = (calls.at_frame(tracker, time + step).dynamics for step in (1, 2))

    def columns(values: jax.Array) -> jax.Array:
        if values.ndim == 2:
            return values
        return jnp.broadcast_to(values[:, None], (values.shape[0], num_particles))

    def parents_of(values: jax.Array) -> jax.Array:
        has_parent = jnp.reshape(parents >= 0, (-1, *[1] * (values.ndim - 2)))
        return jnp.where(has_parent, values[:, jnp.maximum(parents, 0)], 0.0)

    def move(dynamics, part, new, current, previous, parent):
        partition = jnp.full((num_particles,), part)
        parent = columns(parent)
        log_density = contract.log_density_all(
            dynamics, partition, columns(new), current, previous, parent
        )
        return log_density.astype(here.log_weights.dtype)

    def move_on(part, after, new, current, parent):
        return move(to_after, part, after, columns(new), current, parent)

    previous = here.current if here.previous is None else here.previous
    of_parts = jax.vmap(partial(move, to_next), in_axes=(0, 1, 1, 1, 1))(
        parts, drawn.next, here.current, previous, parents_of(drawn.next)
    )
    log_moves = jnp.where(frames_left > 0, jnp.sum(of_parts, axis=0), 0.0)
    if drawn.after is not None:
        of_parts = jax.vmap(move_on, in_axes=(0, 1, 1, 1, 1))(
            parts, drawn.after, drawn.next, here.current, parents_of(drawn.after)
        )
        log_moves += jnp.where(frames_left > 1, jnp.sum(of_parts, axis=0), 0.0)
    if here.label is None:
        return log_moves
    if drawn.label is not None and drawn.label.ndim:
        log_label = jax.vmap(calls.log_label, in_axes=(None, 0, 0, -1))(
            to_next, drawn.label, here.label, jnp.swapaxes(drawn.next, 0, 1)
        )
        return log_moves + jnp.where(frames_left > 0, log_label.astype(log_moves.dtype), 0.0)
    # Labels are few: compute for every label, then look up.
    labels = jnp.arange(jnp.shape(tracker.initial_label)[0])
    log_label = jax.vmap(calls.log_label, in_axes=(None, None, 0, None))(
        to_next, drawn.label, labels, drawn.next.T
    )
    log_label = log_label.astype(log_moves.dtype)
    return log_moves + jnp.where(frames_left > 0, log_label[here.label], 0.0)


def _metropolis(
    key: jax.Array,
    log_weights: jax.Array,
    log_moves_from: Callable[[jax.Array], jax.Array],
    index: jax.Array,
    num_steps: int,
) -> tuple[jax.Array, jax.Array]:
    """Renew the particles ``index`` ``[M]`` of M trajectories; also return which are impossible.

    Args:
        key: a random key.
        log_weights: ``[N]``.
        log_moves_from: function of particles ``[M]`` that returns the log-densities ``[M]`` of the
            trajectories' next moves.
        index: ``[M]`` int32, where the steps start.
        num_steps: number of steps.
    """
    sums = running_sum(jnp.exp(log_weights - jnp.max(log_weights)))
    most = jnp.nextafter(sums[-1], jnp.zeros_like(sums[-1]))

    def step(carry: Any, key: jax.Array) -> Any:
        index, log_moves = carry
        propose, accept = jax.random.uniform(key, (2, *index.shape), sums.dtype)
        target = jnp.minimum(propose * sums[-1], most)
        other = jnp.searchsorted(sums, target, side="right").astype(index.dtype)
        log_other = log_moves_from(other)
        # Of two impossible moves the difference is NaN, and the old one stays.
        accepted = jnp.log(accept) < log_other - log_moves
        return (
            jnp.where(accepted, other, index),
            jnp.where(accepted, log_other, log_moves),
        ), None

    start = index, log_moves_from(index)
    index, log_moves = lax.scan(step, start, jax.random.split(key, num_steps))[0]
    return index, jnp.isneginf(log_moves)


def _pick(uniform: jax.Array, log_weights: jax.Array) -> jax.Array:
    """Draw one particle by its weight ``[N]``, never one of zero weight.

    First draws the block, then the particle inside it.  This avoids a running sum over all
    particles, which costs several times as much as computing the weights.
    """
    num_particles, log_weights = log_weights.shape[0], lax.stop_gradient(log_weights)
    side = max(1, round(num_particles**0.5))
    weights = jnp.exp(log_weights - jnp.max(log_weights))
    blocks = jnp.pad(weights, (0, -num_particles % side)).reshape(-1, side)
    of_blocks = running_sum(jnp.sum(blocks, axis=1))
    block, rest = _first_above(of_blocks, uniform * of_blocks[-1])
    inside = running_sum(blocks[block])
    return block * side + _first_above(inside, rest)[0]


def _first_above(sums: jax.Array, target: jax.Array) -> tuple[jax.Array, jax.Array]:
    """First index at which running sums exceed a target, and the remainder of the target there."""
    target = jnp.minimum(target, jnp.nextafter(sums[-1], jnp.zeros_like(target)))
    place = jnp.sum(sums <= target)
    before = jnp.where(place > 0, sums[jnp.maximum(place - 1, 0)], 0.0)
    return place, jnp.maximum(target - before, 0.0)


@compiled
def trace_back(
    current: jax.Array, sources: jax.Array, log_weights: jax.Array
) -> tuple[jax.Array, ...]:
    """Follow all particles of the last frame back.

    Args:
        current: substates ``[T, D, P, N]``.
        sources: ancestors ``[T, P, N]`` int32, see ``ParticleState``.
        log_weights: ``[N]``, of the last frame.

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
