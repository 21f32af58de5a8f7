"""Smooth a clip, whole or with a fixed lag: run the filter forward, then go back over it."""

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.refusals import poisoned, refused
from jaxpf.contract.state import Summary
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.running import missing_frames, runs
from jaxpf.running.frames import frames_of, num_frames
from jaxpf.smoothing import backward
from jaxpf.smoothing.checks import check_genealogy, check_smoothing, looks_back

#: How trajectories are found: drawn backward exactly or by Metropolis steps, or traced back.
METHODS = ("backward", "metropolis", "genealogy")


@pytree_dataclass
class Smoothed:
    """Posterior of P partitions of D dimensions in T frames, given all frames.

    Attributes:
        estimate: ``[T, P, D]``, mean of the trajectories.
        spread: ``[T, P, D]``, their standard deviation.
        summaries: the filter's summaries, ``[T, ...]``, as from ``jaxpf.run``.
        broken: ``[]`` int32, number of moves in trajectories with zero density from every particle
            tried; the particle was then drawn by its weight alone.  If there are more than a few,
            use more particles.
        paths: ``[K, T, P, D]``, draws of whole trajectories; None unless requested.  Backward
            passes draw those of independent objects separately.
        num_ancestors: ``[T, P]`` int32, number of distinct particles on the paths of the genealogy:
            few tell little, and one has a spread of 0; None with other methods.
    """

    estimate: jax.Array
    spread: jax.Array
    summaries: Summary
    broken: jax.Array
    paths: jax.Array | None = None
    num_ancestors: jax.Array | None = None


class SmoothedFrame(NamedTuple):
    """One smoothed frame, in NumPy arrays.

    Attributes:
        time: number of the frame, from 0.
        estimate: ``[P, D]``.
        spread: ``[P, D]``.
        summary: the filter's summary.
        broken: number of moves in all passes so far with zero density from every particle.
    """

    time: int
    estimate: np.ndarray
    spread: np.ndarray
    summary: Any
    broken: int


def smooth(
    tracker: Partitioned,
    key: jax.Array,
    frames: Any,
    num_trajectories: int | None = None,
    *,
    method: str = "backward",
    num_steps: int = 4,
    lag: int | None = None,
    paths: int = 0,
    observed: Any = None,
    inputs: Any = None,
) -> Smoothed:
    """Track a clip, then smooth it: the posterior of every frame given all frames.

    Backward simulation (Godsill, Doucet & West 2004), see ``jaxpf.smoothing.backward``.  There is
    one backward pass per independent object and one per part tree.  A single pass covers all
    partitions if the likelihood does not factor, particles carry labels, or ``initial`` may draw
    partitions jointly.  If a ``jaxpf.state_space`` keeps the previous state for its likelihood, the
    state alone is smoothed.

    Densities of moves must cover every direction in which particles differ.  For motions without
    noise in some direction, such as the position under a constant velocity, and for motions whose
    density is not known, use the genealogy, with many particles.

    Example::

        smoothed = jaxpf.smooth(tracker, jax.random.key(0), y)
        smoothed.estimate, smoothed.spread  # [T, P, D] each, given all frames

    Args:
        tracker: a ``jaxpf.Partitioned``; its dynamics need ``log_density``, but for the genealogy.
        key: the run's random key; the filter's run is identical to ``jaxpf.run`` with it.
        frames: as for ``jaxpf.run``; with a ``lag`` also an iterable of single frames.
        num_trajectories: M; default the number of particles.
        method: "backward" draws particles exactly, in a time proportional to M N; "metropolis" by
            a few steps from their own ancestors, proportional to M; "genealogy" traces the
            ancestors of the last particles, without densities, see ``jaxpf.smoothing.backward``.
        num_steps: number of Metropolis steps per frame.
        lag: L, use the next L to 2 L frames instead of all later frames.  Memory then does not grow
            with the length of the clip.
        paths: K, number of trajectories to return.
        observed: as for ``jaxpf.run``.
        inputs: as for ``jaxpf.run``; needs frames in arrays.

    Returns:
        A ``Smoothed``.

    Raises:
        InputError: a tracker that cannot be smoothed (``check_smoothing``); fewer than one
            trajectory; a lag below 1; paths or another method with a lag.
    """
    check_known("method=", method, METHODS)
    check_whole("paths", paths, 0)
    if lag is not None:
        if paths or method != "backward":
            asked = f"paths={paths}" if paths else f"method={method!r}"
            raise InputError(
                f"{asked} asks for whole trajectories, which a fixed lag does not draw; leave out "
                "one of the two."
            )
        found = list(smooth_stream(tracker, key, frames, lag, num_trajectories, observed, inputs))
        values = [(frame.estimate, frame.spread, frame.summary) for frame in found]
        estimate, spread, summaries = jax.tree.map(lambda *x: jnp.stack(x), *values)
        return Smoothed(estimate, spread, summaries, jnp.asarray(found[-1].broken))
    frames = frames_of(frames).stacked()
    tracker = runs.with_rows(tracker, inputs, num_frames(frames))
    if method == "genealogy":
        if num_trajectories is not None:
            raise InputError(
                f"the genealogy traces all particles, not num_trajectories={num_trajectories}; "
                "leave it out, or give paths."
            )
        refuse = check_genealogy(tracker)
        smoothed = _traced(tracker, key, frames, paths, observed)
    else:
        refuse, steps = check_smoothing(tracker, whole=True), 0
        if method == "metropolis":
            check_whole("num_steps", num_steps)
            refuse, steps = _check_one_ancestor(tracker, refuse), num_steps
        number = _checked_number(tracker, num_trajectories, paths)
        smoothed = _drawn(tracker, key, frames, number, paths, steps, observed)
    means, deviations, drawn = smoothed.estimate, smoothed.spread, smoothed.paths
    if tracker.sees_previous:
        means, deviations, drawn = jax.tree.map(
            lambda x: x[..., : x.shape[-1] // 2], (means, deviations, drawn)
        )
    smoothed = dataclasses.replace(
        smoothed,
        estimate=calls.moments(tracker, means),
        spread=calls.moments(tracker, deviations),
        paths=calls.states(tracker, drawn) if paths else None,
    )
    return poisoned(refuse, smoothed)


def smooth_stream(
    tracker: Partitioned,
    key: jax.Array,
    frames: Any,
    lag: int,
    num_trajectories: int | None = None,
    observed: Any = None,
    inputs: Any = None,
) -> Iterator[SmoothedFrame]:
    """Smooth frames as they arrive, each given the ``lag`` to ``2 * lag`` frames after it.

    After every ``lag`` frames, a backward pass over the last ``2 * lag`` smooths the first half of
    them.  The states of ``2 * lag`` frames are kept.

    Args:
        tracker: as for ``smooth``.
        key: as for ``smooth``.
        frames: as for ``jaxpf.stream``.
        lag: minimum number of later frames to use.
        num_trajectories: as for ``smooth``.
        observed: as for ``jaxpf.run``.
        inputs: as for ``jaxpf.run``; needs frames in arrays.

    Raises:
        InputError: as for ``smooth``.
    """
    check_whole("lag", lag)
    frames = frames_of(frames)
    if inputs is not None:
        tracker = runs.with_rows(tracker, inputs, num_frames(frames.stacked()))
    check_smoothing(tracker)
    number = _checked_number(tracker, num_trajectories)
    record = backward.keep_both_lags if looks_back(tracker) else backward.keep_substates
    back_key = backward.key_of(runs.as_key(key))
    kept: list[Any] = []  # the weighted set and the summary of each frame that is not smoothed yet
    done = broken = 0

    def smoothed() -> Iterator[SmoothedFrame]:
        """Smooth all kept frames; yield the first ``lag`` of them, and drop them."""
        nonlocal done, broken
        history = jax.tree.map(lambda *x: np.stack(x), *(frame for frame, _ in kept))
        pass_key = jax.random.fold_in(back_key, done // lag)
        passed = backward.back_over(tracker, pass_key, history, number, 0, done)
        broken += int(passed.broken)
        estimate, spread = np.asarray(passed.estimate), np.asarray(passed.spread)
        for place, (_, summary) in enumerate(kept[:lag]):
            means, deviations = (calls.moments(tracker, x[place]) for x in (estimate, spread))
            yield SmoothedFrame(done + place, means, deviations, summary, broken)
        done += lag
        del kept[:lag]

    for tracked in runs.stream(tracker, key, frames, observed):
        # Copied, so that the device need not keep every state.
        frame, summary = record(tracked.state, tracked.summary)
        kept.append((jax.tree.map(np.array, frame._replace(sources=None)), summary))
        if len(kept) == 2 * lag:
            yield from smoothed()
    if not kept:
        raise InputError("frames has no frame; give at least one.")
    while kept:
        yield from smoothed()


def _drawn(tracker, key, frames, num_trajectories, num_paths, num_steps, observed) -> Smoothed:
    """Smooth by backward simulation."""
    record = backward.keep_both_lags if looks_back(tracker) else backward.keep_substates
    if num_steps:
        tracker = dataclasses.replace(tracker, keep_ancestors=True)
    _, (history, summaries) = runs.run(tracker, key, frames, record, observed)
    moved_by = tracker
    if tracker.sees_previous:
        moves = backward.SeenMoves.of(*missing_frames.marked(tracker, frames, observed))
        moved_by = calls.changed_inside(tracker, "dynamics", lambda _: moves)
    back_key = backward.key_of(runs.as_key(key))
    sizes = num_trajectories, num_paths, 0, num_steps
    passed = backward.back_over(moved_by, back_key, history, *sizes)
    return Smoothed(passed.estimate, passed.spread, summaries, passed.broken, passed.paths)


def _traced(tracker, key, frames, num_paths, observed) -> Smoothed:
    """Smooth by the genealogy."""
    tracker = dataclasses.replace(tracker, keep_ancestors=True)
    state, (history, summaries) = runs.run(tracker, key, frames, backward.keep_substates, observed)
    ancestry = history.current, history.sources, state.log_weights
    estimate, spread, num_ancestors = backward.trace_back(*ancestry)
    paths = None
    if num_paths:
        paths = backward.draw_paths(backward.key_of(runs.as_key(key)), *ancestry, num_paths)
    none = jnp.zeros((), jnp.int32)
    return Smoothed(estimate, spread, summaries, none, paths, num_ancestors)


def _check_one_ancestor(tracker: Partitioned, refuse: jax.Array | None) -> jax.Array | None:
    """Refuse Metropolis steps of parts smoothed together that each have an ancestor of their own.

    Args:
        tracker: any tracker.
        refuse: what ``check_smoothing`` returned.

    Returns:
        The same, with the refusals of this function.

    Raises:
        InputError: the ordering exchanges parts of a tree.
    """
    of_trees = any(parts.shape[1] > 1 for parts, _ in backward.groups_of(tracker))
    exchanging = (
        "method='metropolis' starts from the one ancestor of a particle, and an exchange of parts "
        "gives each part its own; use method='backward'.",
    )
    return refused(
        (refuse, ()),
        (tracker.ordering.exchanges & of_trees, exchanging),
    )


def _checked_number(tracker: Partitioned, num_trajectories: int | None, num_paths: int = 0) -> int:
    """Return the number of trajectories; refuse fewer than one, and fewer than paths."""
    if num_trajectories is None:
        return max(tracker.num_particles, num_paths)
    check_whole("num_trajectories", num_trajectories)
    if num_paths > num_trajectories:
        raise InputError(
            f"paths={num_paths} are more than num_trajectories={num_trajectories}; draw as many."
        )
    return num_trajectories
