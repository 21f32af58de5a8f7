"""The synthetic test of Smith and Gatica-Perez (smith2004, section 3): a distracter.

Several objects move over a background of noise.  A distracter that resembles the first object
appears on top of it, moves away from it and disappears.  The first object's reference patch is the
distracter's, so that a tracker prefers the distracter while it is present and follows it; the test
is whether the tracker then recovers the object.

The paper specifies the number and size of the frames, the number of objects, the motion and the
frames in which the distracter appears and vanishes.  Everything else is our choice, documented in
``DistracterParameters``.
"""

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from scenes.drawing import coloured, scattered, with_noise
from scenes.parameters import Count, Parameters, Range, Share, Signed
from scenes.scene import Scene, SceneError

# Every ingredient has its own random stream, so that changing, say, the noise level keeps the
# trajectories of a seed.
_STREAMS = range(5)  # trajectories, textures, background, pixels, patches
_TRIES_PER_OBJECT = 100
_TRIES_PER_LEADER = 2000  # for a rare trajectory
_TRIES_PER_LAYOUT = 50


@dataclasses.dataclass(frozen=True)
class DistracterParameters(Parameters):
    """Parameters of the distracter scene; "paper" marks values from smith2004.

    Lengths are in pixels, colours in grey levels from 0 to 255, angles in degrees; frames count
    from 1, as in the paper.

    Attributes:
        num_frames: length of the sequence (paper: 25).
        frame_width: width of a frame (paper: 360).
        frame_height: height of a frame (paper: 288).
        num_objects: number of objects, without the distracter (paper: 7).
        object_width: width of every object (the paper's real templates are 32 wide).
        object_height: height of every object (the paper's real templates are 33 to 42 high).
        motion_scale: standard deviation of the motion noise in u and in v per frame (paper: 3).
        momentum: b in x_t = x_{t-1} + b (x_{t-1} - x_{t-2}) + motion_scale * n (paper: .5).
        start_jitter: objects start at rest in cells of a grid, in shuffled order, each shifted from
            the centre of its cell by up to this share of the cell's free space.
        separation: minimum gap between the boxes of two objects, in every frame.  Trajectories
            that come closer or leave the frame are redrawn, so the motion is AR2 *conditional* on
            objects staying separate and in view.
        frame_margin: minimum gap between a box and the border of the frame.
        appear_frame: first frame with the distracter, exactly over object 1 (paper: 3).
        vanish_frame: first frame without it (paper: it "disappears in frame 9").
        lead_distance: distance between the centres of the distracter and of object 1 in the last
            frame with the distracter, which moves in a straight line at constant speed.  The faster
            it is, the fewer trackers follow it; the further it goes, the fewer return.
        leader_travel: object 1's trajectory is redrawn until its displacement while the
            distracter is shown is at least this long: it "re-emerges" elsewhere, with the
            "quicker motion" that the paper mentions.
        departure: object 1's trajectory is redrawn until its centre ends at least this far from
            where the distracter vanished, so that a tracker meets it in the last frame only by
            following it.
        likeness: share of the distracter's cells that have object 1's colours, in each half; the
            other cells have a colour that object 1 lacks.  At 1 the two look alike, at 0 they
            share no colour.
        cell_size: side of the square cells of which objects are mosaics.
        accent_share: share of the cells of each half that have the half's second colour.
        saturation: saturation of the objects' colours, 0 to 1.
        brightness: value (in HSV) of the objects' colours, 0 to 1.
        object_noise: standard deviation of the normal noise on the objects' pixels, redrawn in
            every frame, and once for the reference patches.
        background_mean: mean of the background.
        background_noise: standard deviation of the background's normal noise, independent in
            each channel.
        background_grain: side of the squares that share one value of the background noise.
    """

    scene: ClassVar[str] = "distracter"
    num_frames: Count = 25
    frame_width: Count = 360
    frame_height: Count = 288
    num_objects: Count = 7
    object_width: Count = 32
    object_height: Annotated[int, Range(2)] = 42  # two halves
    motion_scale: float = 3.0
    momentum: Signed = 0.5
    start_jitter: Share = 0.5
    separation: float = 6.0
    frame_margin: float = 2.0
    appear_frame: Count = 3
    vanish_frame: int = 9
    lead_distance: float = 45.0
    leader_travel: float = 15.0
    departure: float = 0.0
    likeness: Share = 0.6
    cell_size: Count = 4
    accent_share: Share = 0.3
    saturation: Share = 0.8
    brightness: Share = 0.8
    object_noise: float = 12.0
    background_mean: Signed = 128.0
    background_noise: float = 45.0
    background_grain: Count = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        later = f"must come after appear_frame = {self.appear_frame}"
        self.require("vanish_frame", self.vanish_frame > self.appear_frame, later)


def distracter_scene(parameters: DistracterParameters, seed: int = 0) -> Scene:
    """Generate the scene; the same parameters and seed give the same scene, bit for bit.

    Patch 0 is the distracter's, as in the paper; the others are the objects'
    own.  ``extras`` holds ``distracter_boxes [T, 4]``, NaN where there is no distracter,
    ``distracter_patch``, and ``object_patch``, the patch of object 1 itself.  Boxes are continuous;
    objects are drawn at the nearest whole pixel.
    """
    layout, looks, ground, pixels, patch_noise = (
        np.random.default_rng([seed, stream]) for stream in _STREAMS
    )
    centres, distracter_centres = _draw_layout(parameters, layout)
    textures, distracter_texture = _paint_textures(parameters, looks)
    boxes = _boxes_around(centres, parameters)
    distracter_boxes = _boxes_around(distracter_centres, parameters)
    background = _draw_background(parameters, ground)
    frames = np.repeat(background[None], parameters.num_frames, axis=0)
    for frame, object_boxes, distracter_box in zip(frames, boxes, distracter_boxes, strict=True):
        for box, texture in zip(object_boxes, textures, strict=True):
            _paste(frame, box, with_noise(texture, parameters.object_noise, pixels))
        if not np.isnan(distracter_box[0]):
            noisy = with_noise(distracter_texture, parameters.object_noise, pixels)
            _paste(frame, distracter_box, noisy)
    # Reference patches have noise, like the objects in the frames.
    patches = [with_noise(texture, parameters.object_noise, patch_noise) for texture in textures]
    distracter_patch = with_noise(distracter_texture, parameters.object_noise, patch_noise)
    return Scene(
        name="distracter",
        frames=frames,
        boxes=boxes,
        patches=[distracter_patch, *patches[1:]],
        fps=parameters.fps,
        parameters=parameters.record(seed),
        extras={
            "distracter_boxes": distracter_boxes,
            "distracter_patch": distracter_patch,
            "object_patch": patches[0],
        },
    )


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
    """Centres of the start cells ``[cells, 2]``, and the free space on each side of a cell."""
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
    """Place the objects one by one, each clear of the previous ones; ``None`` if one fails."""
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
    """One coordinate, in plain floats, because arrays of two would be ten times slower."""
    positions = []
    previous = current = float(start)
    for step in noise.tolist():
        positions.append(current)
        previous, current = current, current + momentum * (current - previous) + step
    return positions


def _lead_away(
    parameters: DistracterParameters, trajectory: np.ndarray
) -> tuple[np.ndarray, float]:
    """The distracter's centres ``[T, 2]``, NaN while it is absent, and object 1's displacement.

    The path is straight, back where object 1 came from, and ends at a given distance from it, so
    that every seed has the same gap between the correct and the wrong answer.
    """
    first = parameters.appear_frame - 1
    last = min(parameters.vanish_frame - 1, parameters.num_frames) - 1
    frames = np.arange(parameters.num_frames)
    is_shown = (frames >= first) & (frames <= last)
    if not is_shown.any():  # the sequence ends before the distracter appears
        return np.full_like(trajectory, np.nan), np.inf
    moved = trajectory[last] - trajectory[first]
    travel = float(np.hypot(*moved))
    heading = -moved / travel if travel > 0 else np.array([1.0, 0.0])
    end = trajectory[last] + parameters.lead_distance * heading
    progress = (frames - first) / max(last - first, 1)
    path = trajectory[first] + progress[:, None] * (end - trajectory[first])
    return np.where(is_shown[:, None], path, np.nan), travel


def _departs(
    parameters: DistracterParameters, trajectory: np.ndarray, distracter: np.ndarray
) -> bool:
    """Whether object 1 ends far enough from where the distracter vanished."""
    shown = np.flatnonzero(~np.isnan(distracter[:, 0]))
    if len(shown) == 0:
        return True
    offset = trajectory[-1] - distracter[shown[-1]]
    return float(np.hypot(*offset)) >= parameters.departure


def _is_in_view(parameters: DistracterParameters, centres: np.ndarray) -> bool:
    """Whether the box stays in the frame; NaN frames are ignored."""
    half = np.array([parameters.object_width, parameters.object_height]) / 2
    frame = np.array([parameters.frame_width, parameters.frame_height])
    reach = half + parameters.frame_margin
    return not np.any((centres < reach) | (centres > frame - reach))


def _are_apart(parameters: DistracterParameters, path: np.ndarray, other: np.ndarray) -> bool:
    """Whether the gap is kept in every frame; NaN frames are ignored."""
    size = np.array([parameters.object_width, parameters.object_height])
    return not np.any(np.all(np.abs(path - other) < size + parameters.separation, axis=-1))


# Pictures


def _boxes_around(centres: np.ndarray, parameters: DistracterParameters) -> np.ndarray:
    """``[..., 4]`` boxes around centres ``[..., 2]``; all NaN for a NaN centre."""
    size = np.array([parameters.object_width, parameters.object_height], dtype=np.float64)
    sizes = np.where(np.isnan(centres), np.nan, size)
    return np.concatenate([centres - size / 2, sizes], axis=-1)


def _paint_textures(
    parameters: DistracterParameters, rng: np.random.Generator
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the objects' textures ``[h, w, 3]`` float, and the distracter's.

    Each half shows two hues.  All hues differ between halves and between objects, so that
    histograms of the top and bottom halves distinguish all objects.
    """
    textures = []
    for number in range(parameters.num_objects):
        hue = number / parameters.num_objects
        is_accent = _choose_cells(parameters, parameters.accent_share, rng)
        textures.append(_paint(parameters, is_accent, (hue, hue + 0.45), (hue + 0.12, hue + 0.6)))
    is_foreign = _choose_cells(parameters, 1 - parameters.likeness, rng)
    foreign = _paint(parameters, is_foreign, (0.25, 0.8), (0.25, 0.8))
    return textures, np.where(is_foreign[..., None], foreign, textures[0])


def _choose_cells(
    parameters: DistracterParameters, share: float, rng: np.random.Generator
) -> np.ndarray:
    """``[h, w]`` bool: the given share of the cells of each half, scattered at random."""
    halves = np.bincount(_is_bottom(parameters).astype(int)).tolist()
    width, size = parameters.object_width, parameters.cell_size
    return np.concatenate([scattered(share, height, width, size, rng) for height in halves])


def _paint(
    parameters: DistracterParameters,
    is_accent: np.ndarray,
    main_hues: tuple[float, float],
    accent_hues: tuple[float, float],
) -> np.ndarray:
    """A patch ``[h, w, 3]`` in four hues (0 to 1): main and accent hues of top and bottom."""
    is_bottom = _is_bottom(parameters)[:, None]
    hues = np.where(
        is_accent,
        np.where(is_bottom, accent_hues[1], accent_hues[0]),
        np.where(is_bottom, main_hues[1], main_hues[0]),
    )
    return coloured(hues, parameters.saturation, parameters.brightness)


def _is_bottom(parameters: DistracterParameters) -> np.ndarray:
    return np.arange(parameters.object_height) >= parameters.object_height // 2


def _draw_background(parameters: DistracterParameters, rng: np.random.Generator) -> np.ndarray:
    grain = parameters.background_grain
    rows, columns = -(-parameters.frame_height // grain), -(-parameters.frame_width // grain)
    mean = np.full((rows, columns, 3), parameters.background_mean)
    coarse = with_noise(mean, parameters.background_noise, rng)
    fine = coarse.repeat(grain, axis=0).repeat(grain, axis=1)
    return fine[: parameters.frame_height, : parameters.frame_width]


def _paste(picture: np.ndarray, box: np.ndarray, patch: np.ndarray) -> None:
    """Draw one object in place; the layout guarantees that it lies within the frame."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    height, width = patch.shape[:2]
    picture[top : top + height, left : left + width] = patch
