"""Track a sequence frame by frame, with constant memory and one compiled step."""

import itertools
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering.programs import compiled
from jaxpf.running import missing_frames
from jaxpf.running.frames import frames_of, noted, warn_of_frames
from jaxpf.running.runs import as_key, init_compiled, one_run, summary_only, with_rows

_ENDED = object()


class TrackedFrame(NamedTuple):
    """One tracked frame of a video or a time series, in NumPy arrays.

    Attributes:
        time: number of the frame among those tracked, from 0.
        frame: the input frame.
        state: the tracker's state, still on the device.
        summary: the frame's summary.
    """

    time: int
    frame: np.ndarray
    state: Any
    summary: Any


def stream(
    tracker: TrackerLike,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    observed: Iterable[bool] | None = None,
    state: Any = None,
    inputs: Any = None,
) -> Iterator[TrackedFrame]:
    """Track frames as they come, with the same results as ``jaxpf.run`` with the same key.

    For online filtering of any series: observations ``y`` of a state-space model, pictures of a
    camera.  Frames are not kept, so memory does not grow with the length of the sequence.

    Example::

        for tracked in jaxpf.stream(tracker, jax.random.key(0), y):
            print(tracked.time, tracked.summary.estimate)

    Args:
        tracker: any tracker.
        key: the run's random key.
        frames: an iterable of single frames, or ``[T, ...]``; each as the tracker's likelihood
            takes it, such as a number, a vector or a uint8 RGB picture ``[H, W, 3]``, all of the
            same shape.
        observed: whether each frame was seen, as for ``jaxpf.run``; a dropped frame may hold any
            values of that size.
        state: state after the previous frames, to resume, as for ``jaxpf.run``; frames are
            numbered from its ``time``.
        inputs: known inputs of these frames as for ``jaxpf.run``, or an iterable of each frame's.

    Yields:
        A ``TrackedFrame`` for each frame: ``time``, ``frame``, ``state`` and ``summary``.
    """
    key = as_key(key)
    first = 0 if state is None else int(calls.time_of(state))
    with noted(tracker):
        state = init_compiled(tracker, key) if state is None else state
    seen, given = (
        itertools.repeat(None) if rows is None else frames_of(rows).one_by_one()
        for rows in (observed, inputs)
    )
    told = 0
    for number, frame in enumerate(frames_of(frames).one_by_one(), first):
        rows = {"observed": next(seen, _ENDED), "inputs": next(given, _ENDED)}
        for name, row in rows.items():
            if row is _ENDED:
                raise InputError(f"{name} end before frame {number}; give a row for each frame.")
        one, is_seen, row = jax.tree.map(lambda x: np.asarray(x)[None], (frame, *rows.values()))
        its_tracker = with_rows(tracker, row, 1, number)
        its_tracker, one = missing_frames.marked(its_tracker, one, is_seen, number)
        taken = jax.tree.map(lambda x: x[0], one)
        with noted(tracker):
            state, summary = step(its_tracker, key, number, state, taken)
        summary = jax.tree.map(np.asarray, summary)
        told = warn_of_frames(summary, [frame].__getitem__, number, told)
        yield TrackedFrame(number, frame, state, summary)


@compiled
def step(tracker: TrackerLike, key: jax.Array, time: int, state: Any, frame: np.ndarray) -> Any:
    """Return state and summary of frame ``time`` (from 0) of a run, as in ``stream``."""
    return one_run(tracker, key, summary_only)(state, (time, frame))
