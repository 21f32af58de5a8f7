"""Start files that name later frames."""

from collections.abc import Callable

import numpy as np

from jaxpf.targets.target import Start

#: Frames in a row with a start of one object, from which on a file holds whole tracks.
_WHOLE = 3


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
    rows = set(zip(frames.tolist(), names.tolist(), strict=True))
    if any(all((at + step, name) in rows for step in range(_WHOLE)) for at, name in rows):
        return {}, f"the start file holds whole tracks; only its frame {first} is used."
    return {int(at): start_at(int(at)) for at in np.unique(frames[frames > first])}, None
