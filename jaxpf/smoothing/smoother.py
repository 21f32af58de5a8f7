"""Smoothing a clip, whole or with a fixed lag: forward with the filter, then backward."""

import itertools
from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import running
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import check_not_traced, pytree_dataclass
from jaxpf.running import memory, missing_frames
from jaxpf.running.checks import check_frames, check_run, check_whole
from jaxpf.running.chunks import come_one_by_one
from jaxpf.smoothing.backward import History, Pass, backward
from jaxpf.smoothing.groups import check_smoothing, looks_back, together

#: Number of the key from which trajectories are drawn; frames use those from 0.
_BACKWARD = np.uint32(2**32 - 1)


@pytree_dataclass
class Smoothed:
    """Where P partitions of D dimensions were in T frames, given all frames.

    Attributes:
        estimate: ``[T, P, D]``, mean of the trajectories.
        spread: ``[T, P, D]``, their standard deviation.
        summaries: what the filter reported on the way, ``[T, ...]``, as of ``jaxpf.run``.
        broken: ``[]`` int32, moves of trajectories that no particle could explain; the particle
            was then drawn by its weight alone.  More than a few: give more particles.
        trajectories: ``[M, T, P, D]``, draws of the whole motion; None unless asked for.  Those of
            independent objects are drawn apart.
    """

    estimate: jax.Array
    spread: jax.Array
    summaries: Any
    broken: jax.Array
    trajectories: jax.Array | None = None


class SmoothedFrame(NamedTuple):
    """One smoothed frame, in NumPy arrays.

    Attributes:
        time: number of the frame, from 0.
        estimate: ``[P, D]``.
        spread: ``[P, D]``.
        summary: the filter's; None from ``LookBack``.
        broken: moves that no particle could explain, of all frames looked back over.
    """

    time: int
    estimate: np.ndarray
    spread: np.ndarray
    summary: Any
    broken: int


def smooth(
    tracker: Any,
    key: jax.Array,
    frames: Any,
    num_trajectories: int | None = None,
    *,
    lag: int | None = None,
    keep_trajectories: bool = False,
    observed: Any = None,
) -> Smoothed:
    """Track a clip, then go back over it: the posterior of every frame given all frames.

    Backward simulation (Godsill, Doucet & West 2004), see ``jaxpf.smoothing.backward``: one pass
    for each independent object, one for all parts of a tree, and one for everything where the
    likelihood does not factor, particles carry labels, or ``initial`` may draw jointly.  Every
    dimension needs noise, or the same value in all particles.

    Args:
        tracker: a ``jaxpf.Partitioned`` whose dynamics have ``log_density``.
        key: the filter then runs as ``jaxpf.run`` does with it, bit for bit.
        frames: as for ``jaxpf.run``; with a ``lag`` also an iterable of single frames.
        num_trajectories: M; default as many as there are particles.  The time is proportional to
            M N.
        lag: L, look ahead by L to 2 L frames instead of all: memory then does not grow with the
            length of the clip.
        keep_trajectories: return the trajectories themselves, too.
        observed: as for ``jaxpf.run``.

    Raises:
        InputError: what cannot be smoothed (``check_smoothing``); fewer than one trajectory or
            frame of lag; trajectories of a whole clip from a fixed lag; a clip that is too long
            for the memory without one.
    """
    if lag is not None:
        if keep_trajectories:
            raise InputError(
                "keep_trajectories=True asks for whole trajectories, which a fixed lag does not "
                "draw; leave out one of the two."
            )
        found = list(stream(tracker, key, frames, lag, num_trajectories, observed))
        return Smoothed(
            estimate=jnp.stack([frame.estimate for frame in found]),
            spread=jnp.stack([frame.spread for frame in found]),
            summaries=jax.tree.map(lambda *x: jnp.stack(x), *[frame.summary for frame in found]),
            broken=jnp.asarray(found[-1].broken),
        )
    check_smoothing(tracker)
    if come_one_by_one(frames):
        raise InputError(
            "frames come one by one, and smoothing a whole clip needs them all at once; give a "
            "lag, or np.stack(list(frames))."
        )
    check_frames(frames)
    drawn = _checked_number(tracker, num_trajectories)
    check_length(tracker, running.num_frames(frames), drawn, keep_trajectories)
    record = _record(tracker)
    _, (history, summaries) = running.run(tracker, key, frames, record, observed)
    passed = back_over(tracker, backward_key(key), history, drawn, keep_trajectories)
    return Smoothed(passed.estimate, passed.spread, summaries, passed.broken, passed.trajectories)


def stream(
    tracker: Any,
    key: jax.Array,
    frames: Any,
    lag: int,
    num_trajectories: int | None = None,
    observed: Any = None,
) -> Iterator[SmoothedFrame]:
    """Smooth frames as they come, each by ``lag`` to twice as many that follow it.

    Frames are tracked in blocks of ``lag``; a block is reported when the next one is tracked, by a
    pass back over both.  States of two blocks are kept.

    Args:
        tracker: as for ``smooth``.
        key: as for ``smooth``.
        frames: an array or pytree ``[T, ...]``, or single frames one by one.
        lag: frames to look ahead, at least.
        num_trajectories: as for ``smooth``.
        observed: as for ``jaxpf.run``.

    Raises:
        InputError: as for ``smooth``.
    """
    check_smoothing(tracker)
    check_whole("lag", lag)
    key = running.as_key(key)
    if not come_one_by_one(frames):
        check_frames(frames)
    drawn = _checked_number(tracker, num_trajectories)
    check_length(tracker, 2 * lag, drawn)
    start, broken = 0, 0
    tracked = itertools.chain(
        _tracked(*missing_frames.marked(tracker, frames, observed), key, lag), [None]
    )
    for number, (block, following) in enumerate(itertools.pairwise(tracked)):
        history, summaries = block
        check_not_traced("smoothing with a lag", "jaxpf.smooth without a lag", history)
        length = len(history.log_weights)
        if following is not None:
            history = jax.tree.map(lambda *x: jnp.concatenate(x), history, following[0])
        block_key = jax.random.fold_in(backward_key(key), number)
        passed = back_over(tracker, block_key, history, drawn, False, start)
        broken += int(passed.broken)
        found = jax.tree.map(np.asarray, (passed.estimate[:length], passed.spread[:length]))
        for place, (estimate, spread) in enumerate(zip(*found, strict=True)):
            summary = jax.tree.map(lambda x, place=place: np.asarray(x[place]), summaries)
            yield SmoothedFrame(start + place, estimate, spread, summary, broken)
        start += length


def _tracked(tracker: Any, frames: Any, key: jax.Array, lag: int) -> Iterator[Any]:
    """What is kept of block after block of frames, as ``jaxpf.run`` tracks them."""
    record, state, first = _record(missing_frames.unmarked(tracker, frames)[0]), None, 0
    for block in _blocks(frames, lag):
        of_block = tracker
        if come_one_by_one(frames):
            of_block, block = missing_frames.marked(
                tracker, block
            )  # only now is it known which are missing
        if state is None:
            check_run(*missing_frames.unmarked(of_block, block))
            state = jax.jit(running.init)(tracker, key)
        state, kept = _advance(of_block, key, state, first, block, record)
        first += running.num_frames(block)
        yield kept
    if state is None:
        raise InputError("frames has no frame; give at least one.")


def _blocks(frames: Any, length: int) -> Iterator[Any]:
    """Frames in blocks, the last one of what is left."""
    if not come_one_by_one(frames):
        for first in range(0, running.num_frames(frames), length):
            yield jax.tree.map(lambda x, first=first: x[first : first + length], frames)
        return
    source = iter(frames)
    while block := list(itertools.islice(source, length)):
        yield jax.tree.map(lambda *x: np.stack(x), *block)


@partial(jax.jit, static_argnames="record")
def _advance(tracker, key, state, first, frames, record):
    """State after a block of frames, and what was kept of them."""
    times = first + jnp.arange(running.num_frames(frames))
    return lax.scan(running.one_run(tracker, key, record), state, (times, frames))


def _keep_substates(state: Any, summary: Any) -> Any:
    return History(state.lagged[0], None, state.log_weights, state.label), summary


def _keep_both_lags(state: Any, summary: Any) -> Any:
    return History(state.lagged[0], state.lagged[1], state.log_weights, state.label), summary


def _record(tracker: Any) -> Any:
    return _keep_both_lags if looks_back(tracker) else _keep_substates


def backward_key(key: jax.Array) -> jax.Array:
    """From which trajectories are drawn, of a run's key."""
    return jax.random.fold_in(key, _BACKWARD)


@partial(jax.jit, static_argnames=("num_trajectories", "keep"))
def _backward_groups(tracker, keys, history, parts, parents, num_trajectories, keep, first):
    """One pass after the other over groups of one size, ``[Q, G]``."""

    def one(group):
        key, parts, parents = group
        return backward(tracker, key, history, parts, parents, num_trajectories, keep, first)

    return lax.map(one, (keys, parts, parents))


def back_over(tracker, key, history, num_trajectories, keep, first=0) -> Pass:
    """All partitions' passes, put together: ``[T, P, D]``, and trajectories ``[M, T, P, D]``."""
    found, order = [], []
    for number, (parts, parents) in enumerate(together(tracker)):
        keys = jax.random.split(jax.random.fold_in(key, number), len(parts))
        found.append(
            _backward_groups(tracker, keys, history, parts, parents, num_trajectories, keep, first)
        )
        order.append(parts.reshape(-1))
    back = np.argsort(np.concatenate(order))

    def assembled(name: str) -> jax.Array:
        # [Q, T, ..., D, G] of every size: the groups' partitions side by side, in the order of old.
        by_size = [jnp.moveaxis(getattr(one, name), 0, -2) for one in found]
        flat = [values.reshape(*values.shape[:-2], -1) for values in by_size]
        return jnp.swapaxes(jnp.concatenate(flat, axis=-1)[..., back], -1, -2)

    return Pass(
        estimate=assembled("estimate"),
        spread=assembled("spread"),
        trajectories=jnp.swapaxes(assembled("trajectories"), 0, 1) if keep else None,
        broken=jnp.sum(jnp.stack([jnp.sum(one.broken) for one in found])),
    )


def _checked_number(tracker: Any, num_trajectories: int | None) -> int:
    if num_trajectories is None:
        return tracker.num_particles
    check_whole("num_trajectories", num_trajectories)
    return num_trajectories


def check_length(tracker: Any, num_frames: int, num_trajectories: int, keep: bool = False) -> None:
    """Refuse a clip whose weighted sets do not fit, before it is tracked."""
    state = jax.eval_shape(tracker.init, jax.random.key(0))
    _, dimension, num_partitions, num_particles = state.lagged.shape
    lags = 2 if looks_back(tracker) else 1
    numbers = num_particles * (lags * dimension * num_partitions + 2)
    if keep:
        numbers += 2 * num_trajectories * dimension * num_partitions
    memory.check_memory(
        num_frames * numbers * state.lagged.dtype.itemsize,
        "smooth with a fixed lag, such as jaxpf.smooth(..., lag=50) or --smooth-lag 50, or fewer "
        "particles",
    )
