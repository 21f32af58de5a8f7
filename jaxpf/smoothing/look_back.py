"""Smoothing with a fixed lag, beside the loop over frames."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.running import streaming
from jaxpf.running.frames import frames_of, num_frames
from jaxpf.running.runs import as_key, with_rows
from jaxpf.smoothing import passes
from jaxpf.smoothing.groups import check_smoothing, looks_back


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
        tracker = with_rows(tracker, inputs, num_frames(frames.stacked()))
    check_smoothing(tracker)
    number = passes.checked_number(tracker, num_trajectories)
    record = passes.keep_both_lags if looks_back(tracker) else passes.keep_substates
    back_key = passes.backward_key(as_key(key))
    kept: list[Any] = []  # the weighted set and the summary of each frame that is not smoothed yet
    done = broken = 0

    def smoothed() -> Iterator[SmoothedFrame]:
        """Smooth all kept frames; yield the first ``lag`` of them, and drop them."""
        nonlocal done, broken
        history = jax.tree.map(lambda *x: np.stack(x), *(frame for frame, _ in kept))
        pass_key = jax.random.fold_in(back_key, done // lag)
        passed = passes.back_over(tracker, pass_key, history, number, 0, done)
        broken += int(passed.broken)
        estimate, spread = np.asarray(passed.estimate), np.asarray(passed.spread)
        for place, (_, summary) in enumerate(kept[:lag]):
            means, deviations = (calls.moments(tracker, x[place]) for x in (estimate, spread))
            yield SmoothedFrame(done + place, means, deviations, summary, broken)
        done += lag
        del kept[:lag]

    for tracked in streaming.stream(tracker, key, frames, observed):
        # Copied, so that the device need not keep every state.
        frame, summary = record(tracked.state, tracked.summary)
        kept.append((jax.tree.map(np.array, frame._replace(sources=None)), summary))
        if len(kept) == 2 * lag:
            yield from smoothed()
    if not kept:
        raise InputError("frames has no frame; give at least one.")
    while kept:
        yield from smoothed()
