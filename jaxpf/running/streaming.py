"""Track one video frame by frame, with constant memory and one compiled step."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf import contract, running
from jaxpf.contract.pytree import check_not_traced
from jaxpf.running import missing_frames
from jaxpf.running.checks import check_pytree
from jaxpf.running.chunks import come_one_by_one
from jaxpf.running.runs import check_resumed


class TrackedFrame(NamedTuple):
    """One tracked frame, in NumPy arrays.

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
    tracker: Any,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    observed: Iterable[bool] | None = None,
    state: Any = None,
) -> Iterator[TrackedFrame]:
    """Track frames one by one, with the same results as ``jaxpf.run`` with the same key.

    Frames are not kept: memory does not grow with the length of the video.

    Args:
        tracker: any tracker.
        key: the run's random key.
        frames: uint8 RGB ``[H, W, 3]``, all of the same size.
        observed: whether each frame was seen, as for ``jaxpf.run``; a dropped frame may hold any
            values of that size.
        state: state after the previous frames, to resume, as for ``jaxpf.run``; frames are
            numbered from its ``time``.
    """
    key = running.as_key(key)
    check_pytree(tracker)
    check_resumed(tracker, key, state, running.summary_only)
    whole = () if come_one_by_one(frames) else frames
    check_not_traced("jaxpf.stream", "jaxpf.run", tracker, key, whole, state)
    first = 0 if state is None else int(contract.time_of(state))
    if state is None:
        state = jax.jit(running.init)(tracker, key)
    marked = missing_frames.marked_one_by_one(tracker, frames, observed)
    for number, (frame, marked_tracker, taken) in enumerate(marked, first):
        state, summary = step(marked_tracker, key, number, state, taken)
        check_not_traced("jaxpf.stream", "jaxpf.run", summary)
        yield TrackedFrame(number, frame, state, jax.tree.map(np.asarray, summary))


@jax.jit
def step(tracker: Any, key: jax.Array, time: int, state: Any, frame: np.ndarray) -> Any:
    """Return state and summary of frame ``time`` (from 0) of a run, as in ``stream``."""
    return running.one_run(tracker, key, running.summary_only)(state, (time, frame))
