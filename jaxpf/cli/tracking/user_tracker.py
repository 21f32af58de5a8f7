"""A user-defined tracker from a file named on the command line."""

from typing import TYPE_CHECKING, Any

import scenes
from jaxpf.contract.errors import InputError
from jaxpf.evaluation.trackers import OwnTracker, own_tracker

if TYPE_CHECKING:
    import numpy as np


def tracker_of_start(
    place: str, name: str, frame: "np.ndarray", boxes: "np.ndarray", fps: float
) -> Any:
    """Call a user's function on a scene that consists of the start frame of a video."""
    scene = scenes.Scene(
        name=name,
        frames=frame[None],
        boxes=boxes[None],
        patches=[scenes.cut_patch(frame, box) for box in boxes],
        fps=fps,
        parameters={},
        settings={},
    )
    tracker = own_tracker(place, OwnTracker.read(place), scene)
    if hasattr(tracker, "init"):
        return tracker
    raise InputError(f"the tracker {place!r} returned boxes; for a video return a tracker.")
