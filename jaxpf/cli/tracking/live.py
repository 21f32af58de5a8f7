"""``jaxpf track`` on cameras and streams."""

import collections
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import jax
import numpy as np

from jaxpf.cli.shared.console import say
from jaxpf.contract.errors import InputError
from jaxpf.contract.types import TrackerLike
from jaxpf.media.live import LiveSource
from jaxpf.running.streaming import stream

if TYPE_CHECKING:
    from jaxpf.cli.tracking.session import Session

#: Seconds of camera frames to skip.
_FIRST_SECOND = 1.0
#: Maximum number of start frames to try; two views of a scene rarely differ in compiled shapes.
_ATTEMPTS = 3


def used_to_the_light(frames: Iterator[np.ndarray]) -> np.ndarray:
    """The first frame after a camera's first second, since earlier ones may be dark."""
    until = time.monotonic() + _FIRST_SECOND
    return next(frame for frame in frames if time.monotonic() > until)


def start_when_compiled(session: "Session") -> None:
    """Take a camera's start frame, and build its tracker, once compilation is done.

    Compilation takes seconds, in which the objects move on.
    """
    say("Compiling: leave the objects at their boxes.", err=True)
    for _ in range(_ATTEMPTS):
        one_frame = stream(session.tracker, jax.random.key(0), [session.first])
        collections.deque(one_frame, maxlen=0)
        compiled_for = _kind(session.tracker)
        latest = next(session.frames, None)
        if latest is None:
            raise InputError(
                f"camera '{session.source.path}' stopped; check that it is still plugged in."
            )
        session.tracker, session.first = session.tracker_at(latest, session.start), latest
        if _kind(session.tracker) == compiled_for:
            break
    say("Tracking begins: the start frame is taken.  Ctrl-C ends it.", err=True)
    assert isinstance(session.source, LiveSource)
    session.source.count_from(session.request.run.start)


def _kind(tracker: TrackerLike) -> tuple[jax.tree_util.PyTreeDef, list[tuple[int, ...]]]:
    """Structure and shapes for which a tracker is compiled; learned arrays may vary in length."""
    leaves, structure = jax.tree.flatten(tracker)
    return structure, [np.shape(leaf) for leaf in leaves]
