"""The synthetic test of Rowe, Rius, Gonzalez and Villanueva (rowe2005, section 4): projectiles.

Targets fly under gravity and air friction.  The intensities of targets and background are normally
distributed; two vertical strips of the background have the targets' statistics, so that a target in
front of them resembles its surroundings.  Strong camera noise covers everything.  Boxes shrink
during the first third and grow during the rest.

The paper specifies the number of frames and targets, the areas and the aspect ratios.  Everything
else is our choice, documented in ``ProjectilesParameters``.
"""

import dataclasses
import math
from typing import Annotated, ClassVar, Literal

import numpy as np

from scenes.drawing import as_pixels
from scenes.parameters import Count, Parameters, Range, Share, Signed
from scenes.scene import Scene, SceneError

# Every ingredient has its own random stream, so that changing, say, the noise level keeps the
# trajectories of a seed.
_STREAMS = range(4)  # trajectories, textures, background, noise

_TRIES = 20_000


@dataclasses.dataclass(frozen=True)
class ProjectilesParameters(Parameters):
    """Parameters of the projectiles scene; "paper" marks values from rowe2005.

    Lengths are in pixels, times in frames, intensities in grey levels from 0 to 255.

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

    scene: ClassVar[str] = "projectiles"
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


def projectiles_scene(parameters: ProjectilesParameters, seed: int = 0) -> Scene:
    """Generate the scene; the same parameters and seed give the same scene, bit for bit.

    Patches are the targets' appearance without camera noise, at the largest size.  ``extras``
    holds ``strips [S, 2]``, left and right end of every strip in pixels, and ``speeds [T, L, 2]``,
    the true displacement of every centre since the previous frame.  Boxes are continuous; a pixel
    belongs to a target if its centre lies in the box.
    """
    layout, textures, ground, noise = (np.random.default_rng([seed, stream]) for stream in _STREAMS)
    sizes = _sizes(parameters)
    centres = _draw_centres(parameters, sizes, layout)
    boxes = np.concatenate(
        [centres - sizes[:, None] / 2, np.broadcast_to(sizes[:, None], centres.shape)], axis=-1
    )
    looks = _draw_looks(parameters, textures)
    background, strips = _draw_background(parameters, ground)
    frames = np.empty((parameters.num_frames, *background.shape, 3), np.uint8)
    for time in range(parameters.num_frames):
        picture = background.copy()
        for look, box in zip(looks, boxes[time], strict=True):
            _paste(picture, look, box)
        noisy = picture + parameters.noise * noise.standard_normal(picture.shape, np.float32)
        frames[time] = as_pixels(noisy)[..., None]
    return Scene(
        name="projectiles",
        frames=frames,
        boxes=boxes,
        patches=[_patch(look, sizes[0]) for look in looks],
        fps=parameters.fps,
        parameters=parameters.record(seed),
        extras={"strips": strips, "speeds": np.diff(centres, axis=0, prepend=centres[:1])},
    )


def _sizes(parameters: ProjectilesParameters) -> np.ndarray:
    """``[T, 2]``: width and height, smallest after the first third, changing at constant rates."""

    def sides(area: float, aspect: float) -> np.ndarray:
        return np.array([math.sqrt(area / aspect), math.sqrt(area * aspect)])

    small = sides(parameters.area_small, parameters.aspect_small)
    large = sides(parameters.area_large, parameters.aspect_large)
    times = np.arange(parameters.num_frames)
    turn, last = parameters.num_frames / 3, max(parameters.num_frames - 1, 1)
    share = np.where(times < turn, 1 - times / turn, (times - turn) / max(last - turn, 1))
    return small + np.clip(share, 0, 1)[:, None] * (large - small)


# Trajectories


def _draw_centres(
    parameters: ProjectilesParameters, sizes: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Centres ``[T, L, 2]``: shots, redrawn until they satisfy the parameters."""
    placed: list[np.ndarray] = []
    for _ in range(_TRIES):
        shot = _draw_shot(parameters, len(placed), rng)
        if not _in_view(parameters, shot, sizes):
            continue
        meets = [_meet(parameters, shot, other, sizes) for other in placed]
        if parameters.paths == "apart" and any(meets):
            continue
        if parameters.paths == "crossing" and placed and not meets[-1]:
            continue
        placed.append(shot)
        if len(placed) == parameters.num_targets:
            return np.stack(placed, axis=1)
    raise SceneError(
        f"projectiles scene: no {parameters.num_targets} shots with paths = {parameters.paths!r} "
        f"stay in view for {parameters.num_frames} frames of {parameters.frame_width} x "
        f"{parameters.frame_height}; take fewer targets, another gravity, or a larger frame"
    )


def _draw_shot(
    parameters: ProjectilesParameters, number: int, rng: np.random.Generator
) -> np.ndarray:
    """``[T, 2]``: flight with friction proportional to speed, in closed form."""
    width, height = parameters.frame_width, parameters.frame_height
    times = np.arange(parameters.num_frames)
    decay = 1 - parameters.friction
    travelled = (1 - decay**times) / parameters.friction  # of a speed of 1, without gravity
    reach = rng.uniform(*parameters.reach) * width
    start = rng.uniform(0, width - reach)
    x = (
        start + reach * travelled / travelled[-1]
        if parameters.num_frames > 1
        else start + 0 * times
    )
    if number % 2:
        x = width - x
    terminal = parameters.gravity / parameters.friction
    first = rng.uniform(0, 1) * height
    upwards = rng.uniform(-0.5, 1.5) * parameters.gravity * parameters.num_frames / 2
    y = first - upwards * travelled + terminal * (times - travelled)
    return np.stack([x, y], axis=-1)


def _in_view(parameters: ProjectilesParameters, centres: np.ndarray, sizes: np.ndarray) -> bool:
    frame = np.array([parameters.frame_width, parameters.frame_height])
    reach = sizes / 2 + parameters.frame_margin
    return bool(np.all((centres >= reach) & (centres <= frame - reach)))


def _meet(
    parameters: ProjectilesParameters, path: np.ndarray, other: np.ndarray, sizes: np.ndarray
) -> bool:
    """Whether two boxes ever meet; with paths "apart", whether they come closer than the gap."""
    gap = parameters.separation if parameters.paths == "apart" else 0.0
    return bool(np.any(np.all(np.abs(path - other) < sizes + gap, axis=-1)))


# Pictures


def _draw_looks(parameters: ProjectilesParameters, rng: np.random.Generator) -> list[np.ndarray]:
    """Matrices of intensities, one per target."""
    shape = parameters.cell_rows, parameters.cell_columns
    return [
        mean + parameters.target_deviation * rng.standard_normal(shape)
        for mean in _means(parameters)
    ]


def _means(parameters: ProjectilesParameters) -> np.ndarray:
    return np.linspace(*parameters.target_means, parameters.num_targets)


def _draw_background(
    parameters: ProjectilesParameters, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """``[H, W]`` intensities, and the strips' ends ``[S, 2]``."""
    height, width = parameters.frame_height, parameters.frame_width
    grain = parameters.background_grain
    shape = -(-height // grain), -(-width // grain)
    normal = rng.standard_normal(shape).repeat(grain, axis=0).repeat(grain, axis=1)
    normal = normal[:height, :width].astype(np.float32)
    picture = parameters.background_mean + parameters.background_deviation * normal
    ends = np.zeros((len(parameters.strips), 2))
    means = _means(parameters)
    for number, share in enumerate(parameters.strips):
        left = round(share * width - parameters.strip_width / 2)
        left, right = max(left, 0), min(left + parameters.strip_width, width)
        mean = means[number % len(means)]
        picture[:, left:right] = mean + parameters.target_deviation * normal[:, left:right]
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
