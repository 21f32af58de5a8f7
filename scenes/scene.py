"""A scene: frames, ground truth and reference patches, independent of trackers."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np


class SceneError(ValueError):
    """A scene that cannot be made; the message names the value, the place and a remedy."""


#: Settings of drawn scenes.
DRAWN: Mapping[str, Any] = {"appearance": "colour", "slip": 0.0}


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A short sequence with ground truth.

    Attributes:
        name: of the scene.
        frames: ``[T, H, W, 3]`` uint8, RGB; an array, or frames read on demand.
        boxes: ``[T, P, 4]`` float, the true boxes (x, y, w, h) in pixels, (x, y) the top left
            corner.  A pixel in column c covers c <= x < c + 1.  NaN where an object is absent.
        patches: one reference patch ``[h, w, 3]`` per object, uint8, RGB, from which a tracker
            learns its templates.
        fps: frames per second.
        parameters: everything that determines the scene, including the seed.
        extras: further data; each scene's documentation lists its own.
        settings: values that suit the scene for options of a target that a user leaves open.  A
            drawn scene shows the colours of its patches, so its trackers compare colours and need
            no localisation error; a recording brings no settings.
    """

    name: str
    frames: Any
    boxes: np.ndarray
    patches: list[np.ndarray]
    fps: float
    parameters: dict[str, Any]
    extras: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    settings: Mapping[str, Any] = dataclasses.field(default_factory=lambda: dict(DRAWN))

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


def cut_patch(picture: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Copy the pixels of ``picture [H, W, ...]`` that a box (x, y, w, h) covers.

    Edges are rounded to whole pixels, halves to even.  A box partly outside the picture is clipped;
    a box wholly outside gives a patch of size 0.
    """
    x, y, w, h = box
    left, right = np.clip(np.rint([x, x + w]).astype(int), 0, picture.shape[1])
    top, bottom = np.clip(np.rint([y, y + h]).astype(int), 0, picture.shape[0])
    return picture[top:bottom, left:right].copy()
