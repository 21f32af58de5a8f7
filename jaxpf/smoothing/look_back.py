"""Smoothing with a fixed lag, beside a loop over frames: takes states, returns smoothed frames."""

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf import contract, running
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.state import ParticleState, Summary
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.running.frames import frames_of
from jaxpf.smoothing import passes
from jaxpf.smoothing.backward import History
from jaxpf.smoothing.groups import check_smoothing, looks_back


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


def stream(
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
        tracker = running.with_inputs(tracker, inputs, running.num_frames(frames.stacked()))
    look_back = LookBack(tracker, key, lag, num_trajectories=num_trajectories)
    summaries: deque[Summary] = deque()
    for tracked in running.stream(tracker, key, frames, observed):
        summaries.append(tracked.summary)
        for smoothed in look_back.add(tracked.state):
            yield smoothed._replace(summary=summaries.popleft())
    if not summaries:
        raise InputError("frames has no frame; give at least one.")
    for smoothed in look_back.finish():
        yield smoothed._replace(summary=summaries.popleft())


class LookBack:
    """Smooths states tracked elsewhere, like ``smooth`` or, with a lag, like ``stream``.

    Attributes:
        broken: number of moves so far with zero density from every particle.
    """

    def __init__(
        self,
        tracker: Partitioned,
        key: jax.Array,
        lag: int | None = None,
        first: int = 0,
        num_trajectories: int | None = None,
    ):
        """Start before the first state.

        Args:
            tracker: a ``jaxpf.Partitioned``.
            key: the key of the tracking run.
            lag: as for ``jaxpf.smooth``.
            first: number of the first frame, if earlier frames were tracked before.
            num_trajectories: as for ``jaxpf.smooth``.

        Raises:
            InputError: a tracker that cannot be smoothed; a lag below 1.
        """
        check_smoothing(tracker)
        if lag is not None:
            check_whole("lag", lag)
        check_whole("first", first, 0)
        self._tracker, self._lag = tracker, lag
        self._key = passes.backward_key(running.as_key(key))
        self._num_trajectories = passes.checked_number(tracker, num_trajectories)
        self._has_two_lags = looks_back(tracker)
        self._kept: list[History] = []
        self._start, self._passes, self.broken = first, 0, 0

    def add(self, state: ParticleState) -> list[SmoothedFrame]:
        """Add the next frame's ``ParticleState``; return the frames that are now complete."""
        lagged = np.asarray(state.lagged)
        # Copy, so that the device need not keep every state.
        kept: Any = (
            lagged[0],
            lagged[1] if self._has_two_lags else None,
            state.log_weights,
            state.label,
        )
        arrays: list[Any] = [None if x is None else np.array(x) for x in kept]
        self._kept.append(History(*arrays))
        if self._lag is None or len(self._kept) < 2 * self._lag:
            return []
        return list(self._pass(self._lag))

    def finish(self) -> Iterator[SmoothedFrame]:
        """Yield the remaining frames."""
        while self._kept:
            yield from self._pass(self._lag or len(self._kept))

    def _pass(self, length: int) -> Iterator[SmoothedFrame]:
        """Smooth all stored states; yield the first ``length`` frames and drop their states."""
        key = self._key
        if self._lag is not None:
            key = jax.random.fold_in(key, self._passes)
        history = jax.tree.map(lambda *x: np.stack(x), *self._kept)
        sizes = self._num_trajectories, 0, self._start
        passed = passes.back_over(self._tracker, key, history, *sizes)
        self.broken += int(passed.broken)
        estimate, spread = np.asarray(passed.estimate), np.asarray(passed.spread)
        for place in range(min(length, len(self._kept))):
            time = self._start + place
            mean, deviation = (
                contract.moments(self._tracker, x[place]) for x in (estimate, spread)
            )
            yield SmoothedFrame(time, mean, deviation, None, self.broken)
        self._kept, self._start = self._kept[length:], self._start + length
        self._passes += 1
