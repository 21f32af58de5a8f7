"""The synthetic test of Smith and Gatica-Perez (smith2004, section 3): a distracter.

Several objects wander over a background of noise.  A distracter that resembles the first object
appears on top of it, leads away from it and disappears.  The reference patch of the first object
is the distracter's, so that a tracker prefers the distracter while it is there, is led astray,
and can then show whether it finds its way back.

The paper fixes the number and size of the frames, the number of objects, the motion and the
frames in which the distracter comes and goes.  Everything else is a choice, made here once and
documented in ``DistracterParameters``.
"""

import dataclasses
import math
from typing import Literal

import cv2
import numpy as np

from scenes.scene import Scene, SceneError

# Every ingredient has its own random stream, so that, say, another noise level leaves the
# trajectories of a seed as they are.
_LAYOUT, _TEXTURES, _BACKGROUND, _PIXELS, _PATCHES = range(5)

_TRIES_PER_OBJECT = 100
_TRIES_PER_LEADER = 2000  # where a rare trajectory is asked for
_TRIES_PER_LAYOUT = 50


@dataclasses.dataclass(frozen=True)
class DistracterParameters:
    """What the distracter scene is made of; "paper" marks what smith2004 fixes.

    Lengths are in pixels, colours in grey levels of 0 to 255, angles in degrees, and frames are
    counted from 1, as in the paper.

    Attributes:
        num_frames: length of the sequence (paper: 25).
        frame_width: width of a frame (paper: 360).
        frame_height: height of a frame (paper: 288).
        fps: frames per second; it only matters to a player.
        num_objects: number of objects, the distracter not counted (paper: 7).
        object_width: width of every object (the paper's real templates are 32 wide).
        object_height: height of every object (the paper's real templates are 33 to 42 high).
        motion_scale: standard deviation of the motion noise in u and in v per frame (paper: 3).
        momentum: b in x_t = x_{t-1} + b (x_{t-1} - x_{t-2}) + motion_scale * n (paper: .5).
        start_jitter: objects start at rest in cells of a grid, in shuffled order, each up to this
            share of its cell's free room away from the centre of its cell.
        separation: smallest gap between the boxes of two objects, in every frame; a trajectory
            that comes nearer is drawn again, and so is one that leaves the frame.  So the motion
            is AR2 *given* that objects stay apart and in view.
        frame_margin: smallest gap between a box and the border of the frame.
        appear_frame: first frame with the distracter, exactly over object 1 (paper: 3).
        vanish_frame: first frame without it (paper: it "disappears in frame 9").
        lead_distance: distance between the centres of the distracter and of object 1 in the last
            frame that shows the distracter.  It goes there in a straight line, at constant speed.
            The faster it is, the fewer trackers follow it, and the further, the fewer return.
        lead_direction: where the distracter ends, seen from object 1: 0 right, 90 down; ``None``
            takes the side that object 1 has come from, so that the two part.
        leader_travel: object 1's trajectory is drawn again until its displacement while the
            distracter is shown is at least this long: it "re-emerges" elsewhere, with the
            "quicker motion" that the paper mentions.
        departure: object 1's trajectory is drawn again until its centre ends at least this far from
            the place where the distracter vanished, so that only a tracker that follows it meets it
            in the last frame.
        likeness: share of the distracter's cells that have object 1's colours, in each half; the
            other cells have a colour that object 1 has not.  At 1 the two are alike, at 0 they
            share no colour.
        template_from_distracter: share of the cells of object 1's reference patch that are taken
            from the distracter, the others from object 1 itself (paper: 1, all of them).
        cell_size: objects are mosaics of square cells with this side.
        accent_share: share of the cells of each half that have the half's second colour.
        saturation: saturation of the objects' colours, 0 to 1.
        brightness: value (in HSV) of the objects' colours, 0 to 1.
        object_noise: standard deviation of the normal noise on the objects' pixels, drawn anew in
            every frame, and once for the reference patches.
        background_mean: mean of the background.
        background_noise: standard deviation of the background's normal noise, independent in
            each channel.
        background_grain: side of the squares that share one value of the background noise.
        background_change: "never" keeps one background, "every frame" draws it anew.
    """

    num_frames: int = 25
    frame_width: int = 360
    frame_height: int = 288
    fps: float = 25.0
    num_objects: int = 7
    object_width: int = 32
    object_height: int = 42
    motion_scale: float = 3.0
    momentum: float = 0.5
    start_jitter: float = 0.5
    separation: float = 6.0
    frame_margin: float = 2.0
    appear_frame: int = 3
    vanish_frame: int = 9
    lead_distance: float = 45.0
    lead_direction: float | None = None
    leader_travel: float = 15.0
    departure: float = 0.0
    likeness: float = 0.6
    template_from_distracter: float = 1.0
    cell_size: int = 4
    accent_share: float = 0.3
    saturation: float = 0.8
    brightness: float = 0.8
    object_noise: float = 12.0
    background_mean: float = 128.0
    background_noise: float = 45.0
    background_grain: int = 1
    background_change: Literal["never", "every frame"] = "never"

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            self._check_kind(field.name, field.type)
        for name in (
            *("num_frames", "frame_width", "frame_height", "fps", "num_objects"),
            *("object_width", "object_height", "cell_size", "background_grain"),
        ):
            self._require(name, getattr(self, name) > 0, "must be above 0")
        for name in (
            *("motion_scale", "separation", "frame_margin", "lead_distance", "leader_travel"),
            *("departure", "object_noise", "background_noise"),
        ):
            self._require(name, getattr(self, name) >= 0, "must not be negative")
        for name in (
            *("start_jitter", "likeness", "template_from_distracter"),
            *("accent_share", "saturation", "brightness"),
        ):
            self._require(name, 0 <= getattr(self, name) <= 1, "must lie between 0 and 1")
        self._require("object_height", self.object_height >= 2, "must leave room for two halves")
        self._require("appear_frame", self.appear_frame >= 1, "counts frames from 1")
        self._require(
            "vanish_frame",
            self.vanish_frame > self.appear_frame,
            f"must come after appear_frame = {self.appear_frame}",
        )
        self._require(
            "background_change",
            self.background_change in ("never", "every frame"),
            'must be "never" or "every frame"',
        )

    def _check_kind(self, name: str, kind: object) -> None:
        value = getattr(self, name)
        is_real = isinstance(value, int | float) and not isinstance(value, bool)
        if kind is int:
            self._require(name, is_real and isinstance(value, int), "must be a whole number")
        elif kind is float or (kind == float | None and value is not None):
            self._require(name, is_real and math.isfinite(value), "must be a finite number")

    def _require(self, name: str, holds: bool, remedy: str) -> None:
        if not holds:
            raise SceneError(f"distracter scene: {name} = {getattr(self, name)!r} {remedy}")


def distracter_scene(parameters: DistracterParameters, seed: int = 0) -> Scene:
    """Draw the scene; the same parameters and seed give the same scene, bit for bit.

    Patch 0 is the distracter's (see ``template_from_distracter``), the others are the objects'
    own.  ``extras`` holds ``distracter_boxes [T, 4]``, NaN where there is no distracter,
    ``distracter_patch`` and ``object_patch``, the look of object 1 itself.  Boxes are continuous;
    objects are drawn at the nearest whole pixel.
    """
    centres, distracter_centres = _draw_layout(parameters, _generator(seed, _LAYOUT))
    textures, distracter_texture = _paint_textures(parameters, _generator(seed, _TEXTURES))
    boxes = _boxes_around(centres, parameters)
    distracter_boxes = _boxes_around(distracter_centres, parameters)
    frames = _draw_frames(parameters, seed, boxes, textures, distracter_boxes, distracter_texture)

    # The reference patches are learned from noisy pictures, as the objects are seen.
    rng = _generator(seed, _PATCHES)
    patches = [_with_noise(texture, parameters.object_noise, rng) for texture in textures]
    distracter_patch = _with_noise(distracter_texture, parameters.object_noise, rng)
    from_distracter = _choose_cells(parameters, parameters.template_from_distracter, rng)
    template = np.where(from_distracter[..., None], distracter_patch, patches[0])
    return Scene(
        name="distracter",
        frames=frames,
        boxes=boxes,
        patches=[template, *patches[1:]],
        fps=parameters.fps,
        parameters={**dataclasses.asdict(parameters), "seed": seed},
        extras={
            "distracter_boxes": distracter_boxes,
            "distracter_patch": distracter_patch,
            "object_patch": patches[0],
        },
    )


def _generator(seed: int, stream: int) -> np.random.Generator:
    return np.random.default_rng([seed, stream])


def _boxes_around(centres: np.ndarray, parameters: DistracterParameters) -> np.ndarray:
    """``[..., 4]`` boxes around centres ``[..., 2]``; all NaN where the centre is."""
    size = np.array([parameters.object_width, parameters.object_height], dtype=np.float64)
    sizes = np.where(np.isnan(centres), np.nan, size)
    return np.concatenate([centres - size / 2, sizes], axis=-1)


# Trajectories


def _draw_layout(
    parameters: DistracterParameters, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the objects ``[T, P, 2]`` and of the distracter ``[T, 2]``."""
    cells, room = _grid(parameters)
    for _ in range(_TRIES_PER_LAYOUT):
        start = rng.permutation(cells)[: parameters.num_objects]
        start = start + parameters.start_jitter * room * rng.uniform(-1, 1, start.shape)
        layout = _try_layout(parameters, start, rng)
        if layout is not None:
            return layout
    raise SceneError(
        f"distracter scene: {parameters.num_objects} objects of {parameters.object_width} x "
        f"{parameters.object_height} pixels do not stay apart and in view for "
        f"{parameters.num_frames} frames of {parameters.frame_width} x {parameters.frame_height}; "
        "take fewer or smaller objects, less motion_scale, separation, lead_distance or departure, "
        "or a larger frame"
    )


def _grid(parameters: DistracterParameters) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the start cells ``[cells, 2]`` and the free room of a cell to each side."""
    aspect = parameters.frame_width / parameters.frame_height
    columns = int(np.ceil(np.sqrt(parameters.num_objects * aspect)))
    rows = int(np.ceil(parameters.num_objects / columns))
    cell = np.array([parameters.frame_width / columns, parameters.frame_height / rows])
    indices = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    gap = parameters.separation + 2 * parameters.frame_margin
    size = np.array([parameters.object_width, parameters.object_height])
    return (indices + 0.5) * cell, np.maximum(cell - size - gap, 0) / 2


def _try_layout(
    parameters: DistracterParameters, start: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray] | None:
    """Place one object after the other, each clear of those before it; ``None`` if one fails."""
    leader = distracter = None
    tries = _TRIES_PER_LEADER if parameters.departure > 0 else _TRIES_PER_OBJECT
    for _ in range(tries):
        candidate = _draw_trajectory(parameters, start[0], rng)
        shadow, travel = _lead_away(parameters, candidate)
        if (
            travel >= parameters.leader_travel
            and _departs(parameters, candidate, shadow)
            and _is_in_view(parameters, candidate)
            and _is_in_view(parameters, shadow)
        ):
            leader, distracter = candidate, shadow
            break
    if leader is None or distracter is None:
        return None
    placed = [leader]
    for position in start[1:]:
        for _ in range(_TRIES_PER_OBJECT):
            candidate = _draw_trajectory(parameters, position, rng)
            if _is_in_view(parameters, candidate) and all(
                _are_apart(parameters, candidate, other) for other in [*placed, distracter]
            ):
                placed.append(candidate)
                break
        else:
            return None
    return np.stack(placed, axis=1), distracter


def _draw_trajectory(
    parameters: DistracterParameters, start: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """``[T, 2]``: second-order autoregressive motion (smith2004, section 2), started at rest."""
    noise = parameters.motion_scale * rng.standard_normal((parameters.num_frames, 2))
    return np.stack(
        [_autoregression(start[k], noise[:, k], parameters.momentum) for k in (0, 1)], axis=-1
    )


def _autoregression(start: float, noise: np.ndarray, momentum: float) -> list[float]:
    """One coordinate; plain numbers, for arrays of two would be ten times slower."""
    positions = []
    previous = current = float(start)
    for step in noise.tolist():
        positions.append(current)
        previous, current = current, current + momentum * (current - previous) + step
    return positions


def _lead_away(
    parameters: DistracterParameters, trajectory: np.ndarray
) -> tuple[np.ndarray, float]:
    """The distracter's centres ``[T, 2]``, NaN in the frames without it, and object 1's travel.

    The path is straight and its end lies at a given distance from where object 1 is by then, so
    that every seed has the same gap between the right and the wrong answer.
    """
    first = parameters.appear_frame - 1
    last = min(parameters.vanish_frame - 1, parameters.num_frames) - 1
    frames = np.arange(parameters.num_frames)
    is_shown = (frames >= first) & (frames <= last)
    if not is_shown.any():  # the sequence ends before the distracter appears
        return np.full_like(trajectory, np.nan), np.inf
    moved = trajectory[last] - trajectory[first]
    travel = float(np.hypot(*moved))
    if parameters.lead_direction is not None:
        angle = np.deg2rad(parameters.lead_direction)
        heading = np.array([np.cos(angle), np.sin(angle)])
    else:
        heading = -moved / travel if travel > 0 else np.array([1.0, 0.0])
    end = trajectory[last] + parameters.lead_distance * heading
    progress = (frames - first) / max(last - first, 1)
    path = trajectory[first] + progress[:, None] * (end - trajectory[first])
    return np.where(is_shown[:, None], path, np.nan), travel


def _departs(
    parameters: DistracterParameters, trajectory: np.ndarray, distracter: np.ndarray
) -> bool:
    """Whether object 1 ends as far from the place where the distracter vanished as is asked."""
    shown = np.flatnonzero(~np.isnan(distracter[:, 0]))
    if len(shown) == 0:
        return True
    offset = trajectory[-1] - distracter[shown[-1]]
    return float(np.hypot(*offset)) >= parameters.departure


def _is_in_view(parameters: DistracterParameters, centres: np.ndarray) -> bool:
    """Whether the box stays in the frame; frames with NaN do not count."""
    half = np.array([parameters.object_width, parameters.object_height]) / 2
    frame = np.array([parameters.frame_width, parameters.frame_height])
    reach = half + parameters.frame_margin
    return not np.any((centres < reach) | (centres > frame - reach))


def _are_apart(parameters: DistracterParameters, one: np.ndarray, other: np.ndarray) -> bool:
    """Whether the gap is kept in every frame; frames with NaN do not count."""
    size = np.array([parameters.object_width, parameters.object_height])
    return not np.any(np.all(np.abs(one - other) < size + parameters.separation, axis=-1))


# Pictures


def _paint_textures(
    parameters: DistracterParameters, rng: np.random.Generator
) -> tuple[list[np.ndarray], np.ndarray]:
    """Every object's look ``[h, w, 3]`` float, and the distracter's.

    A half shows two hues.  The halves of an object and the objects differ in their hues, so that
    a histogram of the top and one of the bottom tell all of them apart.
    """
    textures = []
    for number in range(parameters.num_objects):
        hue = number / parameters.num_objects
        is_accent = _choose_cells(parameters, parameters.accent_share, rng)
        textures.append(_paint(parameters, is_accent, (hue, hue + 0.45), (hue + 0.12, hue + 0.6)))
    is_foreign = _choose_cells(parameters, 1 - parameters.likeness, rng)
    foreign = _paint(parameters, is_foreign, (0.25, 0.8), (0.25, 0.8))
    return textures, np.where(is_foreign[..., None], foreign, textures[0])


def _paint(
    parameters: DistracterParameters,
    is_accent: np.ndarray,
    main_hues: tuple[float, float],
    accent_hues: tuple[float, float],
) -> np.ndarray:
    """A patch ``[h, w, 3]`` in four hues (0 to 1): the top's and the bottom's, main and accent."""
    is_bottom = _is_bottom(parameters)[:, None]
    hues = np.where(
        is_accent,
        np.where(is_bottom, accent_hues[1], accent_hues[0]),
        np.where(is_bottom, main_hues[1], main_hues[0]),
    )
    hsv = np.empty((*hues.shape, 3), np.float32)
    hsv[..., 0] = 360 * (hues % 1)
    hsv[..., 1] = parameters.saturation
    hsv[..., 2] = parameters.brightness
    return 255.0 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)


def _is_bottom(parameters: DistracterParameters) -> np.ndarray:
    return np.arange(parameters.object_height) >= parameters.object_height // 2


def _choose_cells(
    parameters: DistracterParameters, share: float, rng: np.random.Generator
) -> np.ndarray:
    """``[h, w]`` bool: the same share of the cells of each half, scattered."""
    size = parameters.cell_size
    columns = -(-parameters.object_width // size)
    chosen = []
    for height in np.bincount(_is_bottom(parameters).astype(int)):
        rows = -(-int(height) // size)
        cells = np.arange(rows * columns) < round(share * rows * columns)
        grid = rng.permutation(cells).reshape(rows, columns)
        half = np.kron(grid, np.ones((size, size), dtype=bool))
        chosen.append(half[:height, : parameters.object_width])
    return np.concatenate(chosen).astype(bool)


def _with_noise(picture: np.ndarray, scale: float, rng: np.random.Generator) -> np.ndarray:
    noisy = picture + scale * rng.standard_normal(picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _draw_background(parameters: DistracterParameters, rng: np.random.Generator) -> np.ndarray:
    grain = parameters.background_grain
    rows, columns = -(-parameters.frame_height // grain), -(-parameters.frame_width // grain)
    mean = np.full((rows, columns, 3), parameters.background_mean)
    coarse = _with_noise(mean, parameters.background_noise, rng)
    fine = coarse.repeat(grain, axis=0).repeat(grain, axis=1)
    return fine[: parameters.frame_height, : parameters.frame_width]


def _draw_frames(
    parameters: DistracterParameters,
    seed: int,
    boxes: np.ndarray,
    textures: list[np.ndarray],
    distracter_boxes: np.ndarray,
    distracter_texture: np.ndarray,
) -> np.ndarray:
    """``[T, H, W, 3]`` uint8: background, objects, and the distracter on top."""
    background_rng, pixel_rng = _generator(seed, _BACKGROUND), _generator(seed, _PIXELS)
    background = _draw_background(parameters, background_rng)
    frames = []
    for frame in range(parameters.num_frames):
        if parameters.background_change == "every frame" and frame > 0:
            background = _draw_background(parameters, background_rng)
        picture = background.copy()
        for number, texture in enumerate(textures):
            _paste(picture, boxes[frame, number], texture, parameters, pixel_rng)
        if not np.isnan(distracter_boxes[frame, 0]):
            _paste(picture, distracter_boxes[frame], distracter_texture, parameters, pixel_rng)
        frames.append(picture)
    return np.stack(frames)


def _paste(
    picture: np.ndarray,
    box: np.ndarray,
    texture: np.ndarray,
    parameters: DistracterParameters,
    rng: np.random.Generator,
) -> None:
    """Draw one object in place.  It lies within the frame: the layout has seen to that."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    height, width = texture.shape[:2]
    noisy = _with_noise(texture, parameters.object_noise, rng)
    picture[top : top + height, left : left + width] = noisy
