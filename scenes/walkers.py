"""Two people who pass each other, seen as heads and shoulders (maccormick1999, figures 1 and 6).

The paper's sequence was never published: two walkers, one of whom occludes the other for less than
a second, tracked in 8 + 8 dimensions.  Here each outline is a closed curve with two shifts and six
modes of deformation.  All numbers are our choices.

``extras``: ``outlines`` ``[T, 2, S, 2]``; ``closed``, true; ``front`` ``[T]``, the target nearer
the camera; ``examples`` ``[E, S, 2]``, similar outlines from which a shape space can be learned,
none of them from the sequence.
"""

import dataclasses
from typing import ClassVar

import numpy as np

from scenes import drawing
from scenes.drawn import Drawn, streams
from scenes.scene import Scene

_POINTS = 80
_MODES = 6


@dataclasses.dataclass(frozen=True)
class Walkers(Drawn):
    """The scene and its parameters.

    Attributes:
        travel: distance that each walker covers, from one side to the other.
        clutter: standard deviation of the background.
        clutter_grain: its smoothing scale.
        noise: standard deviation of every pixel, in every frame.
    """

    name: ClassVar[str] = "walkers"
    travel: float = 170.0
    clutter: float = 25.0
    clutter_grain: float = 4.0
    noise: float = 4.0

    body_height: ClassVar[float] = 120.0  # from the top of the head to the chest
    body_width: ClassVar[float] = 80.0  # across the shoulders
    step_height: ClassVar[float] = 3.0  # amplitude of bobbing
    step_period: ClassVar[float] = 14.0
    deformation: ClassVar[float] = 4.0  # standard deviation of each mode, pixels
    body_grey: ClassVar[float] = 70.0
    num_examples: ClassVar[int] = 80  # E

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        paths, background, pixels, others = streams(seed, 4)
        count, body = self.num_frames, self._body()
        modes, share = self._modes(body), np.linspace(-0.5, 0.5, count)
        outlines = np.empty((count, 2, _POINTS, 2))
        for target in range(2):
            side, phase = (-1) ** target, paths.uniform(0, 2 * np.pi)
            bob = np.sin(2 * np.pi * np.arange(count) / self.step_period + phase)
            x = self.frame_width / 2 + side * share * self.travel
            middle = np.stack([x, self.frame_height / 2 + self.step_height * bob], axis=1)
            weights = drawing.wandering(paths, count, _MODES, 2 * self.step_period)
            weights = weights + paths.standard_normal(_MODES)
            bodies = body + np.einsum("tm,msc->tsc", weights, modes)
            outlines[:, target] = middle[:, None] + bodies
        front = int(paths.integers(2))
        shape = self.frame_height, self.frame_width
        ground = 150 + self.clutter * drawing.texture(background, *shape, self.clutter_grain)

        def paint(picture: np.ndarray, walker: np.ndarray) -> None:
            drawing.paint_body(picture, walker, self.body_grey, seam=self.body_grey + 50)

        grounds, order = [ground] * count, (1 - front, front)
        frames = drawing.painted(grounds, outlines, order, paint, self.noise, pixels)
        weights = 1.4 * others.standard_normal((self.num_examples, _MODES))
        return drawing.scene_of_outlines(
            self,
            seed,
            frames,
            outlines,
            closed=True,
            front=np.full(count, front),
            examples=body + np.einsum("em,msc->esc", weights, modes),
        )

    def _body(self) -> np.ndarray:
        """Head and shoulders about the origin, ``[S, 2]``, clockwise from the top."""
        # Radius by angle: a narrow head, a neck, broad shoulders, a flat chest.
        corners = np.array(
            [(0, -0.5), (0.13, -0.46), (0.19, -0.33), (0.13, -0.19), (0.2, -0.12), (0.42, -0.02),
             (0.5, 0.15), (0.48, 0.5), (0.2, 0.5)]
        )  # fmt: skip
        mirrored = corners[:0:-1] * (-1, 1)
        line = np.concatenate([corners, mirrored, corners[:1]])
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        at = np.linspace(0, along[-1], _POINTS, endpoint=False)
        points = np.stack([np.interp(at, along, line[:, axis]) for axis in range(2)], axis=1)
        return points * (self.body_width, self.body_height)

    def _modes(self, body: np.ndarray) -> np.ndarray:
        """Deformations ``[6, S, 2]``, each ``deformation`` pixels at its largest point."""
        x, y = (body / np.abs(body).max(axis=0)).T
        head, none = np.clip(-2 * y - 0.4, 0, 1), np.zeros_like(x)
        modes = np.array(
            [
                (x, none),
                (none, y),
                (y, none),
                (head, none),
                (none, np.abs(x) * (y < 0.5)),
                (x * head, none),
            ]
        ).transpose(0, 2, 1)
        size = np.linalg.norm(modes, axis=2).max(axis=1)
        return self.deformation * modes / size[:, None, None]
