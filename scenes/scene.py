"""A scene: frames, ground truth and reference patches, independent of trackers."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np


def shown(value: Any, most: int = 80) -> str:
    """Return the ``repr`` of a value, truncated for messages."""
    text = repr(value[: most + 1] if isinstance(value, str) else value)
    return text if len(text) <= most + 2 else f"{text[:most]}..."


class SceneError(ValueError):
    """A scene that cannot be made or read; the message names the value, the place and a remedy.

    Attributes:
        text: the message, or the part of it after ``argument``.
        argument: name and value of the argument that the message begins with, or None.
    """

    def __init__(self, text: str, argument: tuple[str, Any] | None = None):
        super().__init__(f"{argument[0]} = {argument[1]!r} {text}" if argument else text)
        self.text, self.argument = text, argument


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A short sequence with ground truth.

    Attributes:
        name: of the scene.
        frames: ``[T, H, W, 3]`` uint8, RGB; an array, or ``LazyFrames`` for a long recording.
        boxes: ``[T, P, 4]`` float, the true boxes (x, y, w, h) in pixels, (x, y) the top left
            corner.  A pixel in column c covers c <= x < c + 1.  NaN where an object is absent.
        patches: one reference patch ``[h, w, 3]`` per object, uint8, RGB, from which a tracker
            learns its templates.
        fps: frames per second.
        parameters: everything that determines the scene, including the seed.
        extras: further data; each scene's documentation lists its own.
    """

    name: str
    frames: Any
    boxes: np.ndarray
    patches: list[np.ndarray]
    fps: float
    parameters: dict[str, Any]
    extras: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        frames, boxes = self.frames, self.boxes
        if frames.ndim != 4 or frames.shape[-1] != 3 or frames.dtype != np.uint8:
            raise SceneError(
                f"scene {self.name!r}: frames must be uint8 [T, H, W, 3], "
                f"not {frames.dtype} {list(frames.shape)}"
            )
        if boxes.ndim != 3 or boxes.shape[0] != frames.shape[0] or boxes.shape[-1] != 4:
            raise SceneError(
                f"scene {self.name!r}: boxes must be [{frames.shape[0]}, P, 4], "
                f"one row per frame, not {list(boxes.shape)}"
            )
        if len(self.patches) != boxes.shape[1]:
            raise SceneError(
                f"scene {self.name!r}: {boxes.shape[1]} objects need as many reference patches, "
                f"not {len(self.patches)}"
            )

    @property
    def num_frames(self) -> int:
        """T, the number of frames."""
        return self.boxes.shape[0]

    @property
    def num_objects(self) -> int:
        """P, the number of objects."""
        return self.boxes.shape[1]

    @property
    def sizes(self) -> np.ndarray:
        """``[P, 2]``: width and height of every reference patch, in pixels."""
        shapes = [patch.shape[1::-1] for patch in self.patches]
        return np.array(shapes, dtype=np.float64).reshape(-1, 2)
