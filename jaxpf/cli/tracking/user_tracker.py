"""A user-defined tracker from a file named on the command line."""

import hashlib
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import scenes
from jaxpf.contract.errors import InputError
from jaxpf.evaluation.opening import as_input_error
from jaxpf.evaluation.trackers import own_tracker
from jaxpf.files.reading import read_text

if TYPE_CHECKING:
    import numpy as np

    from scenes import Scene


class OwnTracker:
    """A user-defined function of the scene; the file is read once; pickling carries its text.

    Attributes:
        place: ``FILE.py:FUNCTION`` with an absolute path.
        sha256: digest of the file's text.
    """

    def __init__(self, place: str):
        """Read the file."""
        path, colon, self.function = place.rpartition(":")
        if not colon or not path.endswith(".py") or not self.function.isidentifier():
            raise InputError(
                f"the tracker {place!r} has another form than FILE.py:FUNCTION; name a function of "
                "a Python file."
            )
        self.text = read_text(Path(path), "a tracker", "a Python file.")
        if self.function not in self.text:
            names = re.findall(r"^def (\w+)", self.text, re.MULTILINE)
            raise InputError(
                f"'{path}' has no function {self.function!r}; name one that it has: "
                f"{', '.join(names) or 'it has none'}."
            )
        self.path = str(Path(path).resolve())
        self.place = f"{self.path}:{self.function}"
        self.sha256 = hashlib.sha256(self.text.encode()).hexdigest()

    def __call__(self, scene: "Scene") -> Any:
        """Call the function with a scene."""
        try:
            function = scenes.function_of_text(self.text, self.path, self.function)
        except scenes.SceneError as error:
            raise as_input_error(error) from error
        try:
            return function(scene)
        except InputError:
            raise
        except (Exception, SystemExit) as error:
            cause = scenes.cause_of(error, self.path)
            raise InputError(
                f"the tracker {self.place} failed with {cause}; correct it."
            ) from error


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
    tracker = own_tracker(place, OwnTracker(place), scene)
    if hasattr(tracker, "init"):
        return tracker
    raise InputError(f"the tracker {place!r} returned boxes; for a video return a tracker.")
