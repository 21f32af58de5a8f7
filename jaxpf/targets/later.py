"""What start files of several kinds share: places inside the frame, and later frames."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.files.reading import check_pixels
from jaxpf.targets.target import Start

if TYPE_CHECKING:
    from jaxpf.media.film import FrameSource

#: Frames in a row with a start of one object, from which on a file holds whole tracks.
_WHOLE = 3


def check_inside(
    what: str, names: Iterable[object], places: np.ndarray, source: "FrameSource"
) -> None:
    """Refuse x and y ``[P, 2]`` outside the frame; ``what`` they are, such as ``"point"``."""
    check_pixels("the start points", places)
    for name, (x, y) in zip(names, places, strict=True):
        if not (0 <= x < source.width and 0 <= y < source.height):
            raise InputError(
                f"{what} '{name}' is at ({x:g}, {y:g}), outside the frame of {source.width} x "
                f"{source.height} pixels: move it inside, or leave it out."
            )


def holds_whole_tracks(rows: set[tuple[int, Any]]) -> bool:
    """Whether an object has rows ``(frame, name)`` in three frames in a row."""
    return any(all((at + step, name) in rows for step in range(_WHOLE)) for at, name in rows)


def starts_by_frame(
    frames: np.ndarray, names: np.ndarray, first: int, start_at: Callable[[int], Start]
) -> tuple[dict[int, Start], str | None]:
    """Starts by frame, after the first, of a file with one row per frame and object.

    A file that gives an object in three frames in a row holds whole tracks, not starts, and only
    its first frame counts.

    Args:
        frames: int ``[K]``, from 0.
        names: ``[K]``.
        first: the start frame.
        start_at: function from a frame to its objects.

    Returns:
        frame -> start, and a remark for the user or None.
    """
    if holds_whole_tracks(set(zip(frames.tolist(), names.tolist(), strict=True))):
        return {}, f"the start file holds whole tracks; only its frame {first} is used."
    return {int(at): start_at(int(at)) for at in np.unique(frames[frames > first])}, None
