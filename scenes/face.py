"""A face from the front and in profile, after the third sequence of eskil2014 (section 4.2).

Eighteen points in a clip that shows a person twice.  While the head tilts from frame 30 to 60, the
two views move in opposite directions; the eyes blink three times; from frame 56 to 95 the mouth
smiles.  The paper's film (127 frames of 576 x 720, from the MMI database) is not available; details
that the paper does not specify are our choices.
"""

import dataclasses
from collections.abc import Iterator
from typing import Annotated, ClassVar

import cv2
import numpy as np

from scenes.deforming import Body, Points, Pose, Shot, Sketch, bumps, draw, noise
from scenes.drawn import Range

WIDTH = 200.0  # of the frontal face, pixels; errors are relative to it

FRONT = {
    "left brow": (-48, -52),
    "right brow": (48, -52),
    "left eye outer": (-66, -30),
    "left eye inner": (-28, -30),
    "right eye inner": (28, -30),
    "right eye outer": (66, -30),
    "nose tip": (0, 22),
    "left nostril": (-18, 30),
    "right nostril": (18, 30),
    "left lip corner": (-40, 66),
    "right lip corner": (40, 66),
    "upper lip": (0, 56),
}
PROFILE = {
    "profile brow": (42, -54),
    "profile eye": (38, -30),
    "profile nose tip": (82, 20),
    "profile upper lip": (64, 54),
    "profile lower lip": (60, 76),
    "profile chin": (48, 106),
}
#: Frames at the centre of each blink.
BLINKS = (22, 68, 108)


@dataclasses.dataclass(frozen=True)
class Face(Points):
    """The scene and its parameters; an eyelid covers the eye, not its corners.

    Attributes:
        num_frames: length (paper: 127).
        frame_width: of a frame (paper: 720).
        frame_height: of a frame (paper: 576).
        tilt: displacement of each view, in opposite directions.
        smile: displacement of the corners of the mouth.
    """

    name: ClassVar[str] = "face"
    num_frames: Annotated[int, Range(2)] = 127
    frame_width: Annotated[int, Range(640)] = 720
    frame_height: Annotated[int, Range(400)] = 576
    tilt: float = 40.0
    smile: float = 14.0

    points: ClassVar = FRONT | PROFILE

    def shots(self, look: np.random.Generator, path: np.random.Generator) -> Iterator[Shot]:
        """The frames, in which every point is visible."""
        width, height = self.frame_width, self.frame_height
        wall = noise(look, (height, width), 80.0) * 5 + np.array([88.0, 92.0, 104.0])
        wall = wall.astype(np.float32)
        skin = np.array([206.0, 160.0, 134.0])
        skin = skin + (noise(look, _SHAPE, 5.0) * 7 + noise(look, _SHAPE, 24.0) * 6)
        views = [
            (0.3 * width, 1, FRONT, [_front(skin, closed) for closed in (False, True)]),
            (0.74 * width, -1, PROFILE, [_side(skin, closed) for closed in (False, True)]),
        ]
        phases = path.uniform(0, 2 * np.pi, 6)
        for t in range(self.num_frames):
            tilt = self.tilt * np.interp(t, [0, 30, 60, 100, 126], [0, 0, 1, 0.2, 0.5])
            smile = self.smile * np.interp(t, [0, 56, 68, 82, 95, 126], [0, 0, 1, 1, 0, 0])
            sway = 6 * np.sin(0.07 * t + phases[0]), 5 * np.sin(0.09 * t + phases[1])
            closed = max(np.exp(-(((t - blink) / 2.0) ** 2)) for blink in BLINKS)
            smiles = (
                bumps(
                    ((-40, 66), 22.0, (-smile, -0.7 * smile)),
                    ((40, 66), 22.0, (smile, -0.7 * smile)),
                ),
                bumps(((60, 64), 20.0, (-0.6 * smile, -0.2 * smile))),
            )
            frame, where = wall.copy(), []
            for (x, sign, points, (opened, shut)), bend in zip(views, smiles, strict=True):
                at = x + sign * (tilt + sway[0]), 0.5 * height + sway[1] + 0.25 * tilt
                pose = Pose(*at, 1.0, sign * 0.004 * tilt, bend)
                picture = opened.picture + np.float32(closed) * (shut.picture - opened.picture)
                draw(frame, Body(picture, opened.alpha), pose)
                where.append(pose.to_image(np.array(list(points.values()), float)))
            places = np.concatenate(where)
            yield frame, places, np.ones(len(places), bool), WIDTH


_SHAPE = (300, 240)
_HAIR, _DARK, _LIP = (66, 46, 36), (30, 24, 24), (170, 84, 84)


def _eye(picture, centre, closed, reach=19):
    if closed:
        cv2.ellipse(picture, centre, (reach, 4), 0, 0, 180, _DARK, 2, cv2.LINE_AA)
        return
    cv2.ellipse(picture, centre, (reach, 8), 0, 0, 360, (240, 236, 230), -1, cv2.LINE_AA)
    cv2.circle(picture, centre, 8, (72, 92, 110), -1, cv2.LINE_AA)
    cv2.circle(picture, centre, 4, _DARK, -1, cv2.LINE_AA)
    cv2.ellipse(picture, centre, (reach, 9), 0, 180, 360, _DARK, 2, cv2.LINE_AA)


def _front(skin: np.ndarray, closed: bool) -> Body:
    sketch = Sketch(skin)
    picture, alpha, (x, y) = sketch.picture, sketch.alpha, sketch.middle.tolist()
    cv2.ellipse(alpha, (x, y), (100, 140), 0, 0, 360, 255, -1, cv2.LINE_AA)
    cv2.ellipse(picture, (x, y - 96), (104, 50), 0, 0, 360, _HAIR, -1, cv2.LINE_AA)
    for side in (-1, 1):
        _eye(picture, (x + 47 * side, y - 30), closed)
        brow = (x + 30 * side, y - 50), (x + 64 * side, y - 52)
        cv2.line(picture, *brow, _HAIR, 6, cv2.LINE_AA)
        cv2.circle(picture, (x + 18 * side, y + 30), 4, (120, 70, 60), -1, cv2.LINE_AA)
    cv2.line(picture, (x - 8, y - 16), (x - 12, y + 20), (176, 128, 106), 3, cv2.LINE_AA)
    cv2.ellipse(picture, (x, y + 22), (12, 8), 0, 0, 180, (180, 124, 106), 2, cv2.LINE_AA)
    cv2.ellipse(picture, (x, y + 66), (40, 11), 0, 0, 360, _LIP, -1, cv2.LINE_AA)
    cv2.line(picture, (x - 40, y + 66), (x + 40, y + 66), (96, 40, 44), 2, cv2.LINE_AA)
    return sketch.body()


def _side(skin: np.ndarray, closed: bool) -> Body:
    sketch = Sketch(skin)
    picture, alpha, (x, y) = sketch.picture, sketch.alpha, sketch.middle.tolist()
    outline = [
        *((-90, -60), (-60, -120), (0, -138), (44, -110), (54, -60), (52, -36), (86, 18), (62, 36)),
        *((68, 54), (58, 64), (64, 76), (52, 90), (56, 108), (30, 126), (-20, 110), (-60, 60)),
    ]
    shape = np.array(outline, np.int32) + np.array([x, y])
    cv2.fillPoly(alpha, [shape.astype(np.int32)], 255, cv2.LINE_AA)
    cv2.ellipse(picture, (x - 44, y - 84), (76, 62), 0, 0, 360, _HAIR, -1, cv2.LINE_AA)
    _eye(picture, (x + 34, y - 30), closed, reach=11)
    cv2.line(picture, (x + 24, y - 52), (x + 50, y - 56), _HAIR, 6, cv2.LINE_AA)
    cv2.circle(picture, (x + 66, y + 28), 4, (120, 70, 60), -1, cv2.LINE_AA)
    cv2.ellipse(picture, (x + 60, y + 56), (14, 7), 0, 0, 360, _LIP, -1, cv2.LINE_AA)
    cv2.ellipse(picture, (x + 56, y + 74), (12, 7), 0, 0, 360, _LIP, -1, cv2.LINE_AA)
    return sketch.body()
