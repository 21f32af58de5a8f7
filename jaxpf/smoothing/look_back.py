"""Smoothing alongside a tracking loop: takes states frame by frame, returns smoothed frames."""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from jaxpf import running
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import check_not_traced
from jaxpf.smoothing.backward import History
from jaxpf.smoothing.groups import check_smoothing, looks_back
from jaxpf.smoothing.smoother import SmoothedFrame, back_over, backward_key, check_length


class LookBack:
    """Smooths states tracked elsewhere, like ``smooth`` or, with a lag, like ``stream``.

    Attributes:
        broken: number of moves so far with zero density from every particle.
    """

    def __init__(
        self,
        tracker: Any,
        key: jax.Array,
        lag: int | None = None,
        num_frames: int | None = None,
        first: int = 0,
    ):
        """Start before the first state.

        Args:
            tracker: a ``jaxpf.Partitioned``.
            key: the key of the tracking run.
            lag: as for ``jaxpf.smooth``.
            num_frames: number of frames to track, if known.
            first: number of the first frame, if earlier frames were tracked before.

        Raises:
            InputError: a tracker that cannot be smoothed; a lag below 1; not enough memory.
        """
        check_smoothing(tracker)
        if lag is not None:
            check_whole("lag", lag)
        check_whole("first", first, 0)
        self._tracker, self._lag = tracker, lag
        self._key = backward_key(running.as_key(key))
        kept = num_frames if lag is None else 2 * lag
        if kept is not None:
            check_length(tracker, kept, tracker.num_particles)
        self._has_two_lags = looks_back(tracker)
        self._kept: list[History] = []
        self._start, self._passes, self.broken = first, 0, 0

    def add(self, state: Any) -> list[SmoothedFrame]:
        """Add the next frame's ``ParticleState``; return the frames that are now complete."""
        check_not_traced("LookBack", "jaxpf.smooth", state)
        lagged = np.asarray(state.lagged)
        # Copy, so that the device need not keep every state.
        kept: Any = (
            lagged[0],
            lagged[1] if self._has_two_lags else None,
            state.log_weights,
            state.label,
        )
        self._kept.append(
            History._make(None if array is None else np.array(array) for array in kept)
        )
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
        num_trajectories = self._tracker.num_particles
        passed = back_over(self._tracker, key, history, num_trajectories, False, self._start)
        self.broken += int(passed.broken)
        estimate, spread = np.asarray(passed.estimate), np.asarray(passed.spread)
        for place in range(min(length, len(self._kept))):
            time = self._start + place
            yield SmoothedFrame(time, estimate[place], spread[place], None, self.broken)
        self._kept, self._start = self._kept[length:], self._start + length
        self._passes += 1
