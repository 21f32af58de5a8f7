"""A fish in a school of look-alikes, after eskil2014's first sequence (section 4.1, "platty").

Twelve points on one fish.  Look-alikes pass in front of it: they hide its nose and eye from frame
14 to about 45, its dorsal fin from 32 to about 57.  The paper's film (110 frames of 1080 x 1920)
is not available; details that the paper does not specify are our choices.
"""

import dataclasses
from collections.abc import Iterator
from typing import Annotated, ClassVar

import cv2
import numpy as np

from scenes.deforming import Bend, Body, Points, Pose, Shot, covers, draw, noise
from scenes.drawn import Range

LENGTH = 220.0  # of the body, pixels at scale 1
_SHAPE = (120, 240)


@dataclasses.dataclass(frozen=True)
class Fish(Points):
    """The scene and its parameters.

    Attributes:
        num_frames: length (paper: 110).
        frame_width: of a frame (paper: 1920).
        frame_height: of a frame (paper: 1080).
        speed: of the fish, pixels per frame.
        likeness: share of the fish's markings in those of the look-alikes, 0 to 1.
    """

    name: ClassVar[str] = "fish"
    num_frames: Annotated[int, Range(2)] = 110
    frame_width: Annotated[int, Range(480)] = 960
    frame_height: Annotated[int, Range(270)] = 540
    speed: float = 3.0
    likeness: float = 0.5

    wave: ClassVar[float] = 9.0  # amplitude of swimming, at the tail
    #: The nose to the right.
    points: ClassVar = {
        "nose": (100, 4),
        "eye": (78, -8),
        "gill": (52, 6),
        "dorsal front": (28, -34),
        "dorsal back": (-22, -32),
        "belly": (30, 34),
        "pelvic fin": (2, 38),
        "flank": (8, -2),
        "anal fin": (-32, 28),
        "tail root": (-66, 0),
        "tail top": (-94, -26),
        "tail bottom": (-94, 26),
    }

    def shots(self, look: np.random.Generator, path: np.random.Generator) -> Iterator[Shot]:
        """The frames."""
        width, height = self.frame_width, self.frame_height
        water = noise(look, (height, width), 60.0) * 14 + noise(look, (height, width), 9.0) * 6
        background = (water + np.array([62.0, 104.0, 112.0])).astype(np.float32)
        markings = noise(look, _SHAPE, 7.0)
        fish = _fish(markings)
        others = []
        for _ in range(4):
            mixed = self.likeness * markings + (1 - self.likeness) * noise(look, _SHAPE, 7.0)
            others.append(_fish(mixed / mixed.std()))
        phases = path.uniform(0, 2 * np.pi, 6)
        wander = path.uniform(0.8, 1.2, 4)
        places = np.array(list(self.points.values()), float)
        start = max(130.0, width / 2 - self.speed * self.num_frames / 2)
        for t in range(self.num_frames):
            x = start + self.speed * t + 12 * np.sin(0.06 * t + phases[0])
            y = height / 2 + 26 * np.sin(0.045 * wander[0] * t + phases[1])
            tilt = 0.1 * np.sin(0.05 * wander[1] * t + phases[2])
            pose = Pose(x, y, 1.0, tilt, _swimming(self.wave, 0.35 * t + phases[3]))
            far = 0.55 * width + 140 * np.sin(0.02 * t) - 2 * t
            behind = (
                (others[2], Pose(far, 0.24 * height, 0.75, 0.0, _swimming(6, 0.3 * t))),
                (others[3], Pose(0.2 * width + t, 0.8 * height, 0.8, 0.05, _swimming(6, 0.4 * t))),
            )
            # In front: one meets the head and swims along for a while, one passes the dorsal fin.
            along = np.interp(t, [0, 8, 14, 45, 54, 70], [330, 250, 132, 130, 300, 700])
            over = np.interp(t, [0, 20, 32, 57, 68, 80], [-700, -330, -60, 30, 330, 800])
            front = (
                (others[0], Pose(x + along, y + 2, 0.8, 0.0, _swimming(7, 0.3 * t + phases[4]))),
                (others[1], Pose(x + over, y - 40, 1.0, 0.0, _swimming(7, 0.33 * t + phases[5]))),
            )
            frame = background.copy()
            for body, at in (*behind, (fish, pose), *front):
                draw(frame, body, at)
            where = pose.to_image(places)
            hidden = np.any([covers(*each, where) for each in front], axis=0)
            yield frame, where, self.in_view(where) & ~hidden, LENGTH


def _fish(markings: np.ndarray) -> Body:
    """A fish with these markings, [h, w, 3]."""
    height, width = _SHAPE
    middle = np.array([width / 2, height / 2])
    alpha = np.zeros(_SHAPE, np.uint8)
    fins = (
        [(60, -28), (24, -52), (-40, -38), (-30, -20)],
        [(34, 26), (6, 52), (-44, 34), (-30, 18)],
    )
    tail = [(-62, -6), (-108, -40), (-96, 0), (-108, 40), (-62, 6)]
    for outline in (*fins, tail):
        cv2.fillPoly(alpha, [np.round(np.array(outline) + middle).astype(np.int32)], 255)
    body = np.zeros(_SHAPE, np.uint8)
    cv2.ellipse(body, (int(middle[0]) + 16, int(middle[1])), (92, 40), 0, 0, 360, 255, -1)
    alpha = np.maximum(alpha, body)
    colour = np.array([214.0, 132.0, 52.0]) + markings * np.array([26.0, 30.0, 22.0])
    shade = np.linspace(18, -34, height)[:, None, None]
    picture = np.ascontiguousarray(np.clip(colour + shade, 8, 250).astype(np.float32))
    picture[body == 0] *= 0.72
    eye = (int(middle[0]) + 78, int(middle[1]) - 8)
    cv2.circle(picture, eye, 8, (236, 226, 190), -1, cv2.LINE_AA)
    cv2.circle(picture, eye, 4, (16, 14, 18), -1, cv2.LINE_AA)
    gill = (int(middle[0]) + 48, int(middle[1]) + 2)
    cv2.ellipse(picture, gill, (8, 24), 0, -90, 90, (120, 60, 30), 3, cv2.LINE_AA)
    soft = cv2.GaussianBlur(alpha, (3, 3), 0)
    return Body(picture, soft.astype(np.float32) / 255)


def _swimming(amplitude: float, phase: float) -> Bend:
    """A wave that grows towards the tail."""

    def bend(places: np.ndarray) -> np.ndarray:
        along = np.clip((90 - places[..., 0]) / 190, 0, 1.2)
        across = amplitude * along**2 * np.sin(phase + places[..., 0] * np.pi / LENGTH)
        return np.stack([np.zeros_like(across), across], axis=-1)

    return bend
