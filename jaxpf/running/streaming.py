"""Track a sequence frame by frame, with constant memory and one compiled step."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf import contract, running
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import check_not_traced
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering.programs import compiled
from jaxpf.running import missing_frames
from jaxpf.running.checks import as_arrays, check_order, check_pytree, warn_of_frames
from jaxpf.running.chunks import come_one_by_one
from jaxpf.running.runs import check_resumed, init_compiled


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
    frames = as_arrays(frames)
    check_order(tracker, key, frames)
    key = running.as_key(key)
    check_pytree(tracker)
    check_resumed(tracker, key, state, running.summary_only)
    observed = as_arrays(observed)
    whole = () if come_one_by_one(frames) else frames
    check_not_traced("jaxpf.stream", "jaxpf.run", tracker, key, whole, state)
    first = 0 if state is None else int(contract.time_of(state))
    if state is None:
        state = init_compiled(tracker, key)
    marked = missing_frames.marked_one_by_one(tracker, frames, observed)
    given, told = _one_by_one(inputs), 0
    for number, (frame, its_tracker, taken) in enumerate(marked, first):
        if inputs is not None:
            row = next(given, None)
            if row is None:
                raise InputError(f"inputs end before frame {number}; give a row for each frame.")
            row = jax.tree.map(lambda x: np.asarray(x)[None], row)
            its_tracker = running.with_inputs(its_tracker, row, np.zeros(1), number)
        state, summary = step(its_tracker, key, number, state, taken)
        check_not_traced("jaxpf.stream", "jaxpf.run", summary)
        summary = jax.tree.map(np.asarray, summary)
        told = warn_of_frames(summary, [frame].__getitem__, number, told)
        yield TrackedFrame(number, frame, state, summary)


def _one_by_one(inputs: Any) -> Iterator[Any]:
    """Rows of inputs, which are arrays ``[T, ...]`` or come one by one."""
    inputs = as_arrays(inputs)
    if come_one_by_one(inputs):
        yield from inputs
        return
    for place in range(running.num_frames(inputs)):
        yield jax.tree.map(lambda x, place=place: x[place], inputs)


@compiled
def step(tracker: TrackerLike, key: jax.Array, time: int, state: Any, frame: np.ndarray) -> Any:
    """Return state and summary of frame ``time`` (from 0) of a run, as in ``stream``."""
    return running.one_run(tracker, key, running.summary_only)(state, (time, frame))
