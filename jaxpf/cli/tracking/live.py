"""What `jaxpf track` does for cameras and streams, and for those who watch."""

import collections
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from jaxpf.contract.errors import InputError

if TYPE_CHECKING:
    from jaxpf.cli.tracking.request import Request

#: Seconds for which a camera's pictures are passed over.
_FIRST_SECOND = 1.0
#: Start frames that are tried; two views of one scene hardly ever differ in what is compiled.
_ATTEMPTS = 3


def check_live(request: "Request", source: Any) -> None:
    """Refuse what must be known beforehand, and of a camera's frames cannot be.

    Raises:
        InputError: which option.
    """
    if source.is_live and request.run.resume is not None:
        raise InputError(
            f"--resume goes on in a video that begins as it did, and '{source.path}' is live; "
            "leave it out, or record a video first."
        )
    said = {
        "--truth": request.run.truth,
        "--births": request.births,
        "--fit-motion": request.run.fit_motion,
    }
    for flag, value in said.items():
        if source.is_camera and value is not None:
            raise InputError(
                f"{flag} is about frames that are known beforehand, and camera "
                f"'{source.path}' is live; leave it out, or record a video first."
            )


def open_window(source: Any) -> Any:
    """The window of --preview, which closes when the command ends.

    Raises:
        InputError: there is no screen.
    """
    from jaxpf.media.preview import Preview

    window = Preview(f"jaxpf: {source.name}")
    click.get_current_context().call_on_close(window.close)
    return window


def used_to_the_light(frames: Iterator[np.ndarray]) -> np.ndarray:
    """A picture after a camera's first second: earlier ones may be dark."""
    until = time.monotonic() + _FIRST_SECOND
    return next(frame for frame in frames if time.monotonic() > until)


def start_when_compiled(
    make: Callable[[np.ndarray], Any],
    tracker: Any,
    frame: np.ndarray,
    frames: Iterator[np.ndarray],
    source: Any,
) -> tuple[Any, np.ndarray]:
    """A camera's tracker and start frame, taken when nothing is left to compile.

    Objects do not wait, and compiling takes seconds.

    Args:
        make: gives the tracker that starts at a frame.
        tracker: made of an earlier frame.
        frame: that frame.
        frames: of the camera.
        source: the camera.

    Raises:
        InputError: no frame comes.
    """
    import jax

    from jaxpf.running.streaming import stream

    click.echo("Compiling: leave the objects at their boxes.", err=True)
    for _ in range(_ATTEMPTS):
        collections.deque(stream(tracker, jax.random.key(0), [frame]), maxlen=0)
        source.num_left_out, compiled_for = 0, _kind(tracker)
        latest = next(frames, None)
        if latest is None:
            raise InputError(f"camera '{source.path}' stopped; check that it is still plugged in.")
        tracker, frame = make(latest), latest
        if _kind(tracker) == compiled_for:
            break
    click.echo("Tracking begins: the start frame is taken.  Ctrl-C ends it.", err=True)
    return tracker, frame


def _kind(tracker: Any) -> Any:
    """What a tracker is compiled for: what it learned may be of another length."""
    import jax

    leaves, structure = jax.tree.flatten(tracker)
    return structure, [np.shape(leaf) for leaf in leaves]
