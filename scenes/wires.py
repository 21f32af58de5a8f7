"""Two similar pieces of wire that come together and separate (maccormick1999, figure 4).

The paper shows only stills: two wires of similar shape which, "for several frames in the middle
of the sequence, have very similar configurations".  All numbers are our choices.

``extras``: ``outlines`` ``[T, 2, S, 2]``, the centreline of each wire from end to end; ``closed``,
false; ``meeting``, first and last frame of the meeting; ``background`` ``[H, W, 3]``, without
wires.
"""

import dataclasses
from typing import ClassVar

import numpy as np

from scenes import drawing
from scenes.drawn import Count, Drawn, streams
from scenes.scene import Scene

_POINTS = 60


@dataclasses.dataclass(frozen=True)
class Wires(Drawn):
    """The scene and its parameters.

    Attributes:
        wire_width: thickness of the drawn line.
        bend: amplitude of a wire's bend to either side.
        meeting_distance: distance between them while they are together.
        meeting_frames: duration of the meeting, in the middle of the sequence.
        contrast: difference between the ground and the darker wire, grey levels.
        clutter: standard deviation of the ground's grey levels.
        clutter_grain: smoothing scale of the ground.
        noise: standard deviation of every pixel, in every frame.
    """

    name: ClassVar[str] = "wires"
    wire_width: Count = 3
    bend: float = 22.0
    meeting_distance: float = 7.0
    meeting_frames: int = 12
    contrast: float = 90.0
    clutter: float = 12.0
    clutter_grain: float = 3.0
    noise: float = 4.0

    wire_length: ClassVar[float] = 130.0  # from end to end
    unlikeness: ClassVar[float] = 0.15  # relative difference in bend between the wires
    start_distance: ClassVar[float] = 92.0  # between centres, in the first and last frame
    wander: ClassVar[float] = 3.0  # standard deviation in x and y
    turning: ClassVar[float] = 4.0  # the same for the angle, degrees
    wander_period: ClassVar[float] = 30.0

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        paths, background, pixels = streams(seed, 3)
        outlines, meeting = self.paths(paths)
        shape = self.frame_height, self.frame_width
        ground = 150 + self.clutter * drawing.texture(background, *shape, self.clutter_grain)

        def paint(picture: np.ndarray, wire: np.ndarray) -> None:
            drawing.paint_line(picture, wire, 150 - self.contrast, self.wire_width)

        grounds = [ground] * self.num_frames
        return drawing.scene_of_outlines(
            self,
            seed,
            drawing.painted(grounds, outlines, (0, 1), paint, self.noise, pixels),
            outlines,
            closed=False,
            meeting=meeting,
            background=drawing.noisy(ground, self.noise, pixels),
        )

    def paths(self, rng: np.random.Generator) -> tuple[np.ndarray, tuple[int, int]]:
        """Return the centrelines ``[T, 2, S, 2]``, and the first and last meeting frame.

        With the defaults no point moves more than 4.8 pixels per frame, and the second wire stays
        right of the first.
        """
        count = self.num_frames
        last, half = count - 1, self.meeting_frames / 2
        from_middle = np.abs(np.arange(count) - last / 2)
        apart = np.clip((from_middle - half) / max(last / 2 - half, 1), 0, 1)
        apart_smoothly = _eased(apart)
        far, near = self.start_distance, self.meeting_distance
        distance = near + (far - near) * apart_smoothly
        together = np.flatnonzero(apart == 0)
        if not len(together):
            together = np.array([count // 2])
        along, middle = np.linspace(-0.5, 0.5, _POINTS), self.size / 2
        paths = drawing.wandering(rng, count, 6, self.wander_period)
        # Random motion decreases as the wires approach each other, to keep their distance.
        paths *= 0.2 + 0.8 * apart_smoothly[:, None]
        outlines = np.empty((count, 2, _POINTS, 2))
        for wire in range(2):
            bend = self.bend * (1 + wire * self.unlikeness)
            x = bend * np.sin(2 * np.pi * (along + 0.1 * wire * self.unlikeness))
            y = self.wire_length * along
            side = (-1) ** (wire + 1) / 2
            right, down, turn = paths[:, 3 * wire : 3 * wire + 3].T
            right, down = side * distance + self.wander * right, self.wander * down
            angle = np.deg2rad(self.turning * turn)[:, None]
            cosine, sine = np.cos(angle), np.sin(angle)
            outlines[:, wire, :, 0] = middle[0] + right[:, None] + cosine * x - sine * y
            outlines[:, wire, :, 1] = middle[1] + down[:, None] + sine * x + cosine * y
        return outlines, (int(together[0]), int(together[-1]))


def _eased(share: np.ndarray) -> np.ndarray:
    """Ease from 0 to 1 with ``share``: accelerate for a quarter, move steadily, and decelerate."""
    ramp = 0.25
    begins, ends = share**2 / (2 * ramp), 1 - ramp - (1 - share) ** 2 / (2 * ramp)
    steady = share - ramp / 2
    return np.where(share < ramp, begins, np.where(share > 1 - ramp, ends, steady)) / (1 - ramp)
