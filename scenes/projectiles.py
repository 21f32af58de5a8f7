"""The synthetic test of Rowe, Rius, Gonzalez and Villanueva (rowe2005, section 4): projectiles.

Targets fly under gravity and air friction.  The intensities of targets and background are normally
distributed; two vertical strips of the background have the targets' statistics, so that a target in
front of them resembles its surroundings.  Strong camera noise covers everything.  Boxes shrink
during the first third and grow during the rest.

The paper specifies the number of frames and targets, the areas and the aspect ratios.  Everything
else is our choice.
"""

import dataclasses
import math
from typing import Annotated, ClassVar, Literal

import numpy as np

from scenes.drawing import as_pixels, grained
from scenes.drawn import Count, Drawn, Range, Share, Signed, streams
from scenes.scene import Scene, SceneError

_TRIES = 20_000


@dataclasses.dataclass(frozen=True)
class Projectiles(Drawn):
    """The scene and its parameters; "paper" marks values from rowe2005.

    Patches are the targets' appearance without camera noise, at the largest size.  ``extras``
    holds ``strips [S, 2]``, left and right end of every strip in pixels, and ``speeds [T, L, 2]``,
    the true displacement of every centre since the previous frame.  Boxes are continuous; a pixel
    belongs to a target if its centre lies in the box.

    Attributes:
        num_frames: T (paper: 300).
        num_targets: L (paper: 2), shot alternately from the left and from the right.
        paths: "apart" redraws the shots until no two boxes meet, "crossing" until each target meets
            another one, "any" accepts the first.  Later targets are in front.
        separation: minimum gap between two boxes in every frame, with ``paths="apart"``.
        gravity: acceleration downwards, per frame squared.
        friction: fraction of the speed lost in every frame.
        reach: minimum and maximum distance between a shot's start and end, as shares of the frame's
            width.
        frame_margin: minimum gap between a box and the border of the frame.
        target_deviation: standard deviation of a target's intensities.
        background_mean: mean of the background.
        background_grain: side of the squares of equal intensity, in the strips, too.
        strips: centres of the strips, as shares of the frame's width; strip k mimics target k,
            modulo the number of targets (paper: two strips).
        noise: standard deviation of the camera noise, independent for every pixel and frame.
    """

    name: ClassVar[str] = "projectiles"
    num_frames: Count = 300
    frame_width: Count = 360
    frame_height: Count = 288
    num_targets: Count = 2
    paths: Literal["apart", "crossing", "any"] = "apart"
    separation: float = 6.0
    gravity: float = 0.015
    friction: Annotated[float, Range(0, 0.99, is_open=True)] = 0.004
    reach: tuple[Share, Share] = (0.5, 0.8)
    frame_margin: float = 2.0
    target_deviation: float = 30.0
    background_mean: Signed = 130.0
    background_grain: Count = 3
    strips: tuple[Share, ...] = (0.35, 0.65)
    noise: float = 40.0

    area_small: ClassVar[float] = 209.0  # paper
    area_large: ClassVar[float] = 1435.0  # paper
    aspect_small: ClassVar[float] = 1.7  # height over width; paper
    aspect_large: ClassVar[float] = 1.3  # paper
    cell_columns: ClassVar[int] = 4  # of a target's appearance
    cell_rows: ClassVar[int] = 6
    target_means: ClassVar[tuple[float, float]] = (95.0, 165.0)  # first and last target
    background_deviation: ClassVar[float] = 30.0
    strip_width: ClassVar[int] = 30

    def __post_init__(self) -> None:
        super().__post_init__()
        ascending = self.reach[0] <= self.reach[1]
        self.require("reach", ascending, "must be in ascending order")
        enough = self.paths != "crossing" or self.num_targets > 1
        more = f"needs more targets than num_targets = {self.num_targets}"
        self.require("paths", enough, more)

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        layout, textures, ground, noise = streams(seed, 4)
        sizes = self._sizes()
        centres = self._draw_centres(sizes, layout)
        boxes = np.concatenate(
            [centres - sizes[:, None] / 2, np.broadcast_to(sizes[:, None], centres.shape)], axis=-1
        )
        means = np.linspace(*self.target_means, self.num_targets)
        shape = self.cell_rows, self.cell_columns
        looks = [mean + self.target_deviation * textures.standard_normal(shape) for mean in means]
        background, strips = self._draw_background(means, ground)
        frames = np.empty((self.num_frames, *background.shape, 3), np.uint8)
        for frame, of_frame in zip(frames, boxes, strict=True):
            picture = background.copy()
            for look, box in zip(looks, of_frame, strict=True):
                _paste(picture, look, box)
            noisy = picture + self.noise * noise.standard_normal(picture.shape, np.float32)
            frame[...] = as_pixels(noisy)[..., None]
        patches = [_patch(look, sizes[0]) for look in looks]
        speeds = np.diff(centres, axis=0, prepend=centres[:1])
        return self.scene(seed, frames, boxes, patches, strips=strips, speeds=speeds)

    def _sizes(self) -> np.ndarray:
        """``[T, 2]``: width and height, smallest after a third, changing at constant rates."""

        def sides(area: float, aspect: float) -> np.ndarray:
            return np.array([math.sqrt(area / aspect), math.sqrt(area * aspect)])

        small = sides(self.area_small, self.aspect_small)
        large = sides(self.area_large, self.aspect_large)
        times = np.arange(self.num_frames)
        turn, last = self.num_frames / 3, max(self.num_frames - 1, 1)
        share = np.where(times < turn, 1 - times / turn, (times - turn) / max(last - turn, 1))
        return small + np.clip(share, 0, 1)[:, None] * (large - small)

    def _draw_centres(self, sizes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Centres ``[T, L, 2]``: shots, redrawn until they satisfy the parameters."""
        placed: list[np.ndarray] = []
        for _ in range(_TRIES):
            shot = self._draw_shot(len(placed), rng)
            reach = sizes / 2 + self.frame_margin
            if not np.all((shot >= reach) & (shot <= self.size - reach)):
                continue
            gap = self.separation if self.paths == "apart" else 0.0
            meets = [
                np.any(np.all(np.abs(shot - other) < sizes + gap, axis=-1)) for other in placed
            ]
            if self.paths == "apart" and any(meets):
                continue
            if self.paths == "crossing" and placed and not meets[-1]:
                continue
            placed.append(shot)
            if len(placed) == self.num_targets:
                return np.stack(placed, axis=1)
        raise SceneError(
            f"scene {self.name!r}: no {self.num_targets} shots with paths = {self.paths!r} stay in "
            f"view for {self.num_frames} frames of {self.frame_width} x {self.frame_height}; take "
            "fewer targets, another gravity, or a larger frame"
        )

    def _draw_shot(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """``[T, 2]``: flight with friction proportional to speed, in closed form."""
        width, height = self.frame_width, self.frame_height
        times = np.arange(self.num_frames)
        decay = 1 - self.friction
        travelled = (1 - decay**times) / self.friction  # of a speed of 1, without gravity
        reach = rng.uniform(*self.reach) * width
        start = rng.uniform(0, width - reach)
        x = start + reach * travelled / (travelled[-1] if self.num_frames > 1 else 1.0)
        if number % 2:
            x = width - x
        terminal = self.gravity / self.friction
        first = rng.uniform(0, 1) * height
        upwards = rng.uniform(-0.5, 1.5) * self.gravity * self.num_frames / 2
        y = first - upwards * travelled + terminal * (times - travelled)
        return np.stack([x, y], axis=-1)

    def _draw_background(
        self, means: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """``[H, W]`` intensities, and the strips' ends ``[S, 2]``."""

        def draw(rows: int, columns: int) -> np.ndarray:
            return rng.standard_normal((rows, columns))

        normal = grained(draw, self.frame_height, self.frame_width, self.background_grain)
        normal = normal.astype(np.float32)
        picture = self.background_mean + self.background_deviation * normal
        ends = np.zeros((len(self.strips), 2))
        for number, share in enumerate(self.strips):
            left = round(share * self.frame_width - self.strip_width / 2)
            left, right = max(left, 0), min(left + self.strip_width, self.frame_width)
            mean = means[number % len(means)]
            picture[:, left:right] = mean + self.target_deviation * normal[:, left:right]
            ends[number] = left, right
        return picture.astype(np.float32), ends


def _paste(picture: np.ndarray, look: np.ndarray, box: np.ndarray) -> None:
    """Draw an appearance into a box inside the frame: every pixel takes its cell's value."""
    columns, rows = (
        np.arange(math.ceil(start - 0.5), math.ceil(start + extent - 0.5))
        for start, extent in zip(box[:2], box[2:], strict=True)
    )
    across = ((columns + 0.5 - box[0]) / box[2] * look.shape[1]).astype(int)
    down = ((rows + 0.5 - box[1]) / box[3] * look.shape[0]).astype(int)
    across, down = np.clip(across, 0, look.shape[1] - 1), np.clip(down, 0, look.shape[0] - 1)
    picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = look[np.ix_(down, across)]


def _patch(look: np.ndarray, size: np.ndarray) -> np.ndarray:
    width, height = np.rint(size).astype(int)
    picture = np.zeros((height, width))
    _paste(picture, look, np.array([0, 0, width, height]))
    return np.repeat(as_pixels(picture)[..., None], 3, axis=-1)
