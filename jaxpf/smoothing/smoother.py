"""Smooth a clip, whole or with a fixed lag: run the filter forward, then go back over it."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import is_concrete, pytree_dataclass
from jaxpf.contract.refusals import poisoned
from jaxpf.contract.state import Summary
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.running import missing_frames, runs
from jaxpf.running.frames import frames_of, num_frames
from jaxpf.smoothing import passes
from jaxpf.smoothing.backward import SeenMoves
from jaxpf.smoothing.genealogy import draw_paths, trace_back
from jaxpf.smoothing.groups import (
    check_genealogy,
    check_smoothing,
    looks_back,
    sees_previous,
    together,
)
from jaxpf.smoothing.look_back import smooth_stream

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
            ancestors of the last particles, without densities, see ``jaxpf.smoothing.genealogy``.
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
    frames = frames_of(frames)
    if inputs is not None:
        tracker = runs.with_rows(tracker, inputs, num_frames(frames.stacked()))
    if lag is not None:
        if paths or method != "backward":
            asked = f"paths={paths}" if paths else f"method={method!r}"
            raise InputError(
                f"{asked} asks for whole trajectories, which a fixed lag does not draw; leave out "
                "one of the two."
            )
        found = list(smooth_stream(tracker, key, frames, lag, num_trajectories, observed))
        values = [(frame.estimate, frame.spread, frame.summary) for frame in found]
        estimate, spread, summaries = jax.tree.map(lambda *x: jnp.stack(x), *values)
        return Smoothed(estimate, spread, summaries, jnp.asarray(found[-1].broken))
    if method == "genealogy":
        refuse = check_genealogy(tracker)
    else:
        refuse = check_smoothing(tracker, whole=True)
    frames = frames.stacked()
    if method != "backward":
        tracker = dataclasses.replace(tracker, keep_ancestors=True)
    if method == "genealogy":
        if num_trajectories is not None:
            raise InputError(
                f"the genealogy traces all particles, not num_trajectories={num_trajectories}; "
                "leave it out, or give paths."
            )
        smoothed = _traced(tracker, key, frames, paths, observed)
    else:
        drawn = passes.checked_number(tracker, num_trajectories, paths)
        steps = 0
        if method == "metropolis":
            check_whole("num_steps", num_steps)
            _check_one_ancestor(tracker)
            steps = num_steps
        smoothed = _drawn(tracker, key, frames, drawn, paths, steps, observed)
    if sees_previous(tracker):
        half = smoothed.estimate.shape[-1] // 2
        estimate, spread, kept = jax.tree.map(
            lambda x: x[..., :half], (smoothed.estimate, smoothed.spread, smoothed.paths)
        )
        smoothed = dataclasses.replace(smoothed, estimate=estimate, spread=spread, paths=kept)
    smoothed = dataclasses.replace(
        smoothed,
        estimate=calls.moments(tracker, smoothed.estimate),
        spread=calls.moments(tracker, smoothed.spread),
        paths=calls.states(tracker, smoothed.paths) if paths else None,
    )
    return poisoned(refuse, smoothed)


def _drawn(tracker, key, frames, num_trajectories, num_paths, num_steps, observed) -> Smoothed:
    """Smooth by backward simulation."""
    second_order = looks_back(tracker)
    record = passes.keep_both_lags if second_order else passes.keep_substates
    _, (history, summaries) = runs.run(tracker, key, frames, record, observed)
    moved_by = tracker
    if sees_previous(tracker):
        moves = SeenMoves.of(*missing_frames.marked(tracker, frames, observed))
        moved_by = calls.changed_inside(tracker, "dynamics", lambda _: moves)
    back_key = passes.backward_key(runs.as_key(key))
    sizes = num_trajectories, num_paths, 0, num_steps
    passed = passes.back_over(moved_by, back_key, history, *sizes)
    return Smoothed(passed.estimate, passed.spread, summaries, passed.broken, passed.paths)


def _traced(tracker, key, frames, num_paths, observed) -> Smoothed:
    """Smooth by the genealogy."""
    record = passes.keep_substates
    state, (history, summaries) = runs.run(tracker, key, frames, record, observed)
    ancestry = history.current, history.sources, state.log_weights
    estimate, spread, num_ancestors = trace_back(*ancestry)
    paths = None
    if num_paths:
        paths = draw_paths(passes.backward_key(runs.as_key(key)), *ancestry, num_paths)
    none = jnp.zeros((), jnp.int32)
    return Smoothed(estimate, spread, summaries, none, paths, num_ancestors)


def _check_one_ancestor(tracker: Partitioned) -> None:
    """Refuse Metropolis steps of parts smoothed together that each have an ancestor of their own.

    Raises:
        InputError: the ordering exchanges parts of a tree.
    """
    exchanges = is_concrete(tracker.ordering) and np.asarray(tracker.ordering.exchanged).any()
    if exchanges and any(parts.shape[1] > 1 for parts, _ in together(tracker)):
        raise InputError(
            "method='metropolis' starts from the one ancestor of a particle, and an exchange of "
            "parts gives each part its own; use method='backward'."
        )
