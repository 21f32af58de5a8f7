"""Smooth a clip, whole or with a fixed lag: run the filter forward, then a backward pass."""

import itertools
from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract, running
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import check_not_traced, pytree_dataclass
from jaxpf.contract.refusals import poisoned
from jaxpf.running import memory, missing_frames
from jaxpf.running.checks import as_arrays, check_frames, check_run
from jaxpf.running.chunks import come_one_by_one
from jaxpf.smoothing.backward import History, Pass, SeenMoves, backward
from jaxpf.smoothing.groups import check_smoothing, looks_back, sees_previous, together

#: Index of the key for backward passes; frames use indices from 0.
_BACKWARD = np.uint32(2**32 - 1)


@pytree_dataclass
class Smoothed:
    """Posterior of P partitions of D dimensions in T frames, given all frames.

    Attributes:
        estimate: ``[T, P, D]``, mean of the trajectories.
        spread: ``[T, P, D]``, their standard deviation.
        summaries: the filter's summaries, ``[T, ...]``, as from ``jaxpf.run``.
        broken: ``[]`` int32, number of moves in trajectories with zero density from every particle;
            the particle was then drawn by its weight alone.  If there are more than a few, use more
            particles.
        trajectories: ``[M, T, P, D]``, draws of whole trajectories; None unless requested.
            Trajectories of independent objects are drawn separately.
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
        summary: the filter's summary; None from ``LookBack``.
        broken: number of moves in all passes so far with zero density from every particle.
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
    inputs: Any = None,
) -> Smoothed:
    """Track a clip, then smooth it: the posterior of every frame given all frames.

    Backward simulation (Godsill, Doucet & West 2004), see ``jaxpf.smoothing.backward``.  There is
    one backward pass per independent object and one per part tree.  A single pass covers all
    partitions if the likelihood does not factor, particles carry labels, or ``initial`` may draw
    partitions jointly.  Every dimension needs noise, or the same value in all particles.  If a
    ``jaxpf.state_space`` keeps the previous state for its likelihood, the state alone is smoothed.

    Args:
        tracker: a ``jaxpf.Partitioned`` whose dynamics have ``log_density``.
        key: the run's random key; the filter's run is identical to ``jaxpf.run`` with it.
        frames: as for ``jaxpf.run``; with a ``lag`` also an iterable of single frames.
        num_trajectories: M; default the number of particles.  Time is proportional to M N.
        lag: L, use the next L to 2 L frames instead of all later frames.  Memory then does not grow
            with the length of the clip.
        keep_trajectories: whether to return the trajectories too.
        observed: as for ``jaxpf.run``.
        inputs: as for ``jaxpf.run``; needs frames in arrays.

    Raises:
        InputError: a tracker that cannot be smoothed (``check_smoothing``); fewer than one
            trajectory; a lag below 1; ``keep_trajectories`` with a lag; a clip without a lag that
            does not fit into memory.
    """
    frames = as_arrays(frames)
    tracker = running.with_inputs(tracker, inputs, frames)
    if lag is not None:
        if keep_trajectories:
            raise InputError(
                "keep_trajectories=True asks for whole trajectories, which a fixed lag does not "
                "draw; leave out one of the two."
            )
        smoothed = list(stream(tracker, key, frames, lag, num_trajectories, observed))
        return Smoothed(
            estimate=jnp.stack([frame.estimate for frame in smoothed]),
            spread=jnp.stack([frame.spread for frame in smoothed]),
            summaries=jax.tree.map(lambda *x: jnp.stack(x), *[frame.summary for frame in smoothed]),
            broken=jnp.asarray(smoothed[-1].broken),
        )
    refuse = check_smoothing(tracker, whole=True)
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
    moved_by = tracker
    if sees_previous(tracker):
        moves = SeenMoves.of(*missing_frames.marked(tracker, frames, observed))
        moved_by = contract.changed_inside(tracker, "dynamics", lambda _: moves)
    passed = back_over(moved_by, backward_key(key), history, drawn, keep_trajectories)
    if sees_previous(tracker):
        half = passed.estimate.shape[-1] // 2
        passed = jax.tree.map(lambda x: x[..., :half] if x.ndim else x, passed)
    return poisoned(
        refuse,
        Smoothed(passed.estimate, passed.spread, summaries, passed.broken, passed.trajectories),
    )


def stream(
    tracker: Any,
    key: jax.Array,
    frames: Any,
    lag: int,
    num_trajectories: int | None = None,
    observed: Any = None,
) -> Iterator[SmoothedFrame]:
    """Smooth frames as they arrive, each given the ``lag`` to ``2 * lag`` frames after it.

    Frames are tracked in blocks of ``lag``.  When the next block has been tracked, a backward pass
    over both blocks smooths the first.  States of two blocks are kept.

    Args:
        tracker: as for ``smooth``.
        key: as for ``smooth``.
        frames: an array or pytree ``[T, ...]``, or an iterable of single frames.
        lag: minimum number of later frames to use.
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
        running.num_frames(frames)
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
        moments = jax.tree.map(np.asarray, (passed.estimate[:length], passed.spread[:length]))
        for place, (estimate, spread) in enumerate(zip(*moments, strict=True)):
            summary = jax.tree.map(lambda x, place=place: np.asarray(x[place]), summaries)
            yield SmoothedFrame(start + place, estimate, spread, summary, broken)
        start += length


def _tracked(tracker: Any, frames: Any, key: jax.Array, lag: int) -> Iterator[Any]:
    """Track blocks of frames as ``jaxpf.run`` does; yield each block's recorded values."""
    record, state, first = _record(missing_frames.unmarked(tracker, frames)[0]), None, 0
    for block in _blocks(frames, lag):
        of_block = tracker
        if come_one_by_one(frames):
            # Missing frames are known only now.
            of_block, block = missing_frames.marked(tracker, block, first=first)
        if state is None:
            check_run(*missing_frames.unmarked(of_block, block))
            state = jax.jit(running.init)(tracker, key)
        state, kept = _advance(of_block, key, state, first, block, record)
        first += running.num_frames(block)
        yield kept
    if state is None:
        raise InputError("frames has no frame; give at least one.")


def _blocks(frames: Any, length: int) -> Iterator[Any]:
    """Split frames into blocks; the last one may be shorter."""
    if not come_one_by_one(frames):
        for first in range(0, running.num_frames(frames), length):
            yield jax.tree.map(lambda x, first=first: x[first : first + length], frames)
        return
    source = iter(frames)
    while block := list(itertools.islice(source, length)):
        yield jax.tree.map(lambda *x: np.stack(x), *block)


@partial(jax.jit, static_argnames="record")
def _advance(tracker, key, state, first, frames, record):
    """Advance the state by a block of frames; also return the recorded values."""
    times = first + jnp.arange(running.num_frames(frames))
    return lax.scan(running.one_run(tracker, key, record), state, (times, frames))


def _keep_substates(state: Any, summary: Any) -> Any:
    return History(state.lagged[0], None, state.log_weights, state.label), summary


def _keep_both_lags(state: Any, summary: Any) -> Any:
    return History(state.lagged[0], state.lagged[1], state.log_weights, state.label), summary


def _record(tracker: Any) -> Any:
    return _keep_both_lags if looks_back(tracker) else _keep_substates


def backward_key(key: jax.Array) -> jax.Array:
    """Derive the key for drawing trajectories from a run's key."""
    return jax.random.fold_in(key, _BACKWARD)


@partial(jax.jit, static_argnames=("num_trajectories", "keep"))
def _backward_groups(tracker, keys, history, parts, parents, num_trajectories, keep, first):
    """Run backward passes in sequence over groups of the same size, ``[Q, G]``."""

    def of_group(group):
        key, parts, parents = group
        return backward(tracker, key, history, parts, parents, num_trajectories, keep, first)

    return lax.map(of_group, (keys, parts, parents))


def back_over(tracker, key, history, num_trajectories, keep, first=0) -> Pass:
    """Smooth all partitions and join the passes: ``[T, P, D]``, trajectories ``[M, T, P, D]``."""
    results, order = [], []
    for number, (parts, parents) in enumerate(together(tracker)):
        keys = jax.random.split(jax.random.fold_in(key, number), len(parts))
        results.append(
            _backward_groups(tracker, keys, history, parts, parents, num_trajectories, keep, first)
        )
        order.append(parts.reshape(-1))
    back = np.argsort(np.concatenate(order))

    def assembled(name: str) -> jax.Array:
        # [Q, T, ..., D, G] of every size: concatenate the groups' partitions in original order.
        by_size = [jnp.moveaxis(getattr(result, name), 0, -2) for result in results]
        flat = [values.reshape(*values.shape[:-2], -1) for values in by_size]
        return jnp.swapaxes(jnp.concatenate(flat, axis=-1)[..., back], -1, -2)

    return Pass(
        estimate=assembled("estimate"),
        spread=assembled("spread"),
        trajectories=jnp.swapaxes(assembled("trajectories"), 0, 1) if keep else None,
        broken=jnp.sum(jnp.stack([jnp.sum(result.broken) for result in results])),
    )


def _checked_number(tracker: Any, num_trajectories: int | None) -> int:
    if num_trajectories is None:
        return tracker.num_particles
    check_whole("num_trajectories", num_trajectories)
    return num_trajectories


def check_length(tracker: Any, num_frames: int, num_trajectories: int, keep: bool = False) -> None:
    """Refuse a clip whose weighted sets do not fit into memory, before tracking it."""
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
