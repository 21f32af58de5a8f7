"""The backward pass: trajectories drawn from the last frame to the first (Godsill et al. 2004).

At the last frame a particle is drawn by its weight.  At every frame before, by its weight times the
density of the move to what was drawn already.  For motion of second order, a particle
(x_t, x_{t-1}) is drawn by ::

    w_t f(x_{t+1} | x_t, x_{t-1}) f(x_{t+2} | x_{t+1}, x_t)

and then x_{t-1} is forgotten: to keep it would leave a single particle to choose at the frame
before, the one that drew it.  There is no second factor at the last frame but one.

The cost is quadratic: each of M trajectories tries all N particles of every frame.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf import contract
from jaxpf.lowering.prefix import running_sum

#: Numbers of one array in a pass over particles and trajectories: what a core's cache holds.
_CHUNK = 2**17


class History(NamedTuple):
    """The weighted sets of T frames.

    Attributes:
        current: ``[T, D, P, N]``.
        previous: ``[T, D, P, N]``, substates of the frame before; None where no move asks for it.
        log_weights: ``[T, N]``.
        label: ``[T, N]`` int32; None where particles carry none.
    """

    current: jax.Array
    previous: jax.Array | None
    log_weights: jax.Array
    label: jax.Array | None


class Drawn(NamedTuple):
    """What a trajectory has of the frames to come, or M trajectories, with an axis in front.

    Attributes:
        next: ``[D, G]``, the substates of the next frame.
        after: ``[D, G]``, those of the frame after; None where no move asks for it.
        label: ``[]``, of the next frame; None without labels.
    """

    next: jax.Array
    after: jax.Array | None
    label: jax.Array | None


class Pass(NamedTuple):
    """What the backward pass over a group of G partitions gives.

    Attributes:
        estimate: ``[T, D, G]``, mean of the trajectories.
        spread: ``[T, D, G]``, their standard deviation.
        trajectories: ``[T, M, D, G]``, or None unless asked for.
        broken: ``[]`` int32, moves that no particle could explain.
    """

    estimate: jax.Array
    spread: jax.Array
    trajectories: jax.Array | None
    broken: jax.Array


def backward(
    tracker: Any,
    key: jax.Array,
    history: History,
    parts: jax.Array,
    parents: jax.Array,
    num_trajectories: int,
    keep: bool,
    first: Any = 0,
) -> Pass:
    """Draw trajectories of one group of partitions.

    Args:
        tracker: whose dynamics moved the particles.
        key: a random key.
        history: of all partitions.
        parts: ``[G]`` int32, the group.
        parents: ``[G]`` int32, place in the group of each one's parent, -1 for a root.
        num_trajectories: M.
        keep: whether to return the trajectories themselves.
        first: number of the history's first frame.
    """
    num_frames = history.log_weights.shape[0]
    dimension, dtype = history.current.shape[1], history.current.dtype
    whole = jnp.zeros((num_trajectories, dimension, parts.shape[0]), dtype)
    start = Drawn(
        next=whole,
        after=None if history.previous is None else whole,
        label=None if history.label is None else jnp.zeros((num_trajectories,), jnp.int32),
    )
    chunk = max(1, _CHUNK // (parts.shape[0] * history.log_weights.shape[1]))

    def step_back(drawn: Drawn, item: Any) -> tuple[Drawn, Any]:
        (current, previous, log_weights, label), time, key = item
        uniforms = jax.random.uniform(key, (num_trajectories,), dtype)
        here = History(
            current[:, parts], None if previous is None else previous[:, parts], log_weights, label
        )
        frames_left = num_frames - 1 - time

        def draw(one: tuple[Drawn, jax.Array]) -> tuple[jax.Array, jax.Array]:
            log_moves = log_densities(
                tracker, here, one[0], parts, parents, frames_left, first + time
            )
            possible = jnp.isfinite(log_moves) & ~jnp.isneginf(log_weights)
            broken = ~jnp.any(possible)
            by_move = jnp.where(possible, log_weights + log_moves, -jnp.inf)
            return _pick(one[1], jnp.where(broken, log_weights, by_move)), broken

        index, broken = lax.map(draw, (drawn, uniforms), batch_size=min(chunk, num_trajectories))
        chosen = jnp.moveaxis(here.current[:, :, index], -1, 0)  # [M, D, G]
        drawn = Drawn(
            next=chosen,
            after=None if drawn.after is None else drawn.next,
            label=None if label is None else label[index],
        )
        estimate = jnp.mean(chosen, axis=0)
        spread = jnp.sqrt(jnp.mean((chosen - estimate) ** 2, axis=0))
        broken = jnp.sum(broken, dtype=jnp.int32)
        return drawn, (estimate, spread, chosen if keep else None, broken)

    items = history, jnp.arange(num_frames), jax.random.split(key, num_frames)
    estimate, spread, trajectories, broken = lax.scan(step_back, start, items, reverse=True)[1]
    return Pass(estimate, spread, trajectories, jnp.sum(broken))


def log_densities(
    tracker: Any,
    here: History,
    drawn: Drawn,
    parts: jax.Array,
    parents: jax.Array,
    frames_left: jax.Array,
    time: Any,
) -> jax.Array:
    """Log-densities ``[N]`` of a trajectory's next moves from every particle of a frame.

    Args:
        tracker: whose dynamics move.
        here: the frame, its substates ``[D, G, N]``.
        drawn: one trajectory.
        parts: see ``backward``.
        parents: see ``backward``.
        frames_left: ``[]``, how many frames come after this one.
        time: the frame's number, by which dynamics may change.
    """
    num_particles = here.log_weights.shape[0]
    to_next, to_after = (contract.at_frame(tracker, time + step).dynamics for step in (1, 2))

    def columns(values: jax.Array) -> jax.Array:
        return jnp.broadcast_to(values[:, None], (values.shape[0], num_particles))

    def parents_of(values: jax.Array) -> jax.Array:
        return jnp.where(parents >= 0, values[:, jnp.maximum(parents, 0)], 0.0)

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
    # Computed for every label, then looked up: there are few of them.
    labels = jnp.arange(jnp.shape(tracker.initial_label)[0])
    log_label = jax.vmap(contract.log_label, in_axes=(None, None, 0, None))(
        to_next, drawn.label, labels, drawn.next.T
    )
    log_label = log_label.astype(log_moves.dtype)
    return log_moves + jnp.where(frames_left > 0, log_label[here.label], 0.0)


def _pick(uniform: jax.Array, log_weights: jax.Array) -> jax.Array:
    """One particle drawn by its weight ``[N]``, never one of zero weight.

    In two looks, first for the block and then inside it: a sum over all costs as much as the
    weights themselves, a running sum several times as much.
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
    """The first place at which running sums exceed a target, and what of it is left there."""
    target = jnp.minimum(target, jnp.nextafter(sums[-1], jnp.zeros_like(target)))
    place = jnp.sum(sums <= target)
    before = jnp.where(place > 0, sums[jnp.maximum(place - 1, 0)], 0.0)
    return place, jnp.maximum(target - before, 0.0)
