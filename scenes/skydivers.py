"""One skydiver among others, after the second sequence of eskil2014 (section 4.1).

Seven points on a body of about 75 pixels.  The other divers wear nearly the same suits and drift
close by; the background is crowded from frame 50 to 80, with a white cloud that the diver passes
around frame 75; from frame 200 on the diver grows.  The paper's film (300 frames of 480 x 656) is
not available; details that the paper does not specify are our choices.
"""

import dataclasses
from collections.abc import Iterator
from typing import Annotated, ClassVar

import cv2
import numpy as np

from scenes.deforming import Body, Points, Pose, Shot, Sketch, bumps, covers, draw, noise
from scenes.drawn import Range

LENGTH = 75.0  # of the body, pixels at scale 1


@dataclasses.dataclass(frozen=True)
class Skydivers(Points):
    """The scene and its parameters.

    Attributes:
        num_frames: length (paper: 300).
        frame_width: of a frame (paper: 656).
        frame_height: of a frame (paper: 480).
        growth: the diver's scale in the last frame; it changes from frame 200 on.
    """

    name: ClassVar[str] = "skydivers"
    num_frames: Annotated[int, Range(2)] = 300
    frame_width: Annotated[int, Range(320)] = 656
    frame_height: Annotated[int, Range(240)] = 480
    growth: float = 1.3

    sway: ClassVar[float] = 4.0  # amplitude of hands and feet
    suit_noise: ClassVar[float] = 14.0  # the only difference between divers
    #: The head up.
    points: ClassVar = {
        "head": (0, -30),
        "left hand": (-34, -26),
        "right hand": (34, -26),
        "chest": (0, -10),
        "hip": (0, 10),
        "left foot": (-22, 36),
        "right foot": (22, 36),
    }

    def shots(self, look: np.random.Generator, path: np.random.Generator) -> Iterator[Shot]:
        """The frames."""
        width, height = self.frame_width, self.frame_height
        sky = noise(look, (height, width), 90.0) * 9 + noise(look, (height, width), 14.0) * 5
        sky = (sky + np.array([96.0, 138.0, 190.0])).astype(np.float32)
        cloud = np.clip(noise(look, (height, width), 40.0, 1) * 0.25 + 0.75, 0, 1)
        divers = [_diver(look, self.suit_noise) for _ in range(5)]
        phases = path.uniform(0, 2 * np.pi, (5, 8))
        places = np.array(list(self.points.values()), float)
        rows, columns = np.mgrid[:height, :width]
        for t in range(self.num_frames):
            frame = sky.copy()
            centre = 0.5 * width + 5.0 * (75 - t)
            blob = np.exp(-(((columns - centre) / 130) ** 2) - ((rows - 0.45 * height) / 90) ** 2)
            alpha = np.clip(2.2 * blob, 0, 1)[..., None] * cloud
            frame += alpha.astype(np.float32) * (np.float32(240) - frame)
            scale = 1 + (self.growth - 1) * np.clip((t - 200) / 99, 0, 1)
            x = 0.5 * width + 55 * np.sin(0.021 * t + phases[0, 0]) - 55 * np.sin(phases[0, 0])
            y = 0.5 * height + 34 * np.sin(0.027 * t + phases[0, 1])
            crowd = np.interp(t, [0, 45, 55, 78, 90, 299], [150, 140, 84, 82, 140, 150])
            for number in range(1, 4):
                turn = 2 * np.pi * number / 3 + 0.006 * t + phases[number, 0] * 0.1
                at = x + crowd * np.cos(turn), y + 0.8 * crowd * np.sin(turn)
                draw(frame, divers[number], self._pose(*at, 0.97, t, phases[number]))
            pose = self._pose(x, y, scale, t, phases[0])
            draw(frame, divers[0], pose)
            # One diver passes in front, from right to left.
            before = self._pose(x + 6.0 * (135 - t), y + 30, 1.0, t, phases[4])
            draw(frame, divers[4], before)
            where = pose.to_image(places)
            visible = self.in_view(where) & ~covers(divers[4], before, where)
            yield frame, where, visible, LENGTH * scale

    def _pose(self, x: float, y: float, scale: float, t: int, phases: np.ndarray) -> Pose:
        """A diver's pose, slightly rotating, with swaying hands and feet."""
        rates = {"left hand": 0.11, "right hand": 0.13, "left foot": 0.09, "right foot": 0.1}
        swings = []
        for (limb, rate), phase in zip(rates.items(), phases[2:6], strict=True):
            turn = rate * t + phase
            swing = self.sway * np.cos(turn), self.sway * np.sin(1.3 * turn)
            swings.append((self.points[limb], 14.0, swing))
        return Pose(x, y, scale, 0.15 * np.sin(0.02 * t + phases[6]), bumps(*swings))


def _diver(rng: np.random.Generator, suit_noise: float) -> Body:
    """A body with spread arms and legs, in a suit with individual markings."""
    sketch = Sketch(np.array([172.0, 44.0, 48.0]) + suit_noise * noise(rng, (100, 100), 6.0))
    for side in (-1, 1):
        sketch.limb((6 * side, -14), (26 * side, -20), 9)
        sketch.limb((26 * side, -20), (34 * side, -26), 8, (226, 178, 150))
        sketch.limb((5 * side, 12), (16 * side, 26), 11)
        sketch.limb((16 * side, 26), (22 * side, 36), 10, (34, 34, 40))
    sketch.limb((0, -14), (0, 12), 24)
    sketch.limb((-8, -4), (8, -4), 4, (238, 226, 90))
    x, y = sketch.middle.tolist()
    cv2.circle(sketch.alpha, (x, y - 30), 9, 255, -1, cv2.LINE_AA)
    cv2.circle(sketch.picture, (x, y - 30), 10, (40, 46, 120), -1, cv2.LINE_AA)
    cv2.circle(sketch.picture, (x, y - 27), 4, (222, 176, 148), -1, cv2.LINE_AA)
    return sketch.body()
