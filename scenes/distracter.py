"""The synthetic test of Smith and Gatica-Perez (smith2004, section 3): a distracter.

Several objects move over a background of noise.  A distracter that resembles the first object
appears on top of it, moves away from it and disappears.  The first object's reference patch is the
distracter's, so that a tracker prefers the distracter while it is present and follows it; the test
is whether the tracker then recovers the object.

The paper specifies the number and size of the frames, the number of objects, the motion and the
frames in which the distracter appears and vanishes.  Everything else is our choice.
"""

import dataclasses
from typing import Annotated, ClassVar

import numpy as np

from scenes.drawing import coloured, grained, scattered, with_noise
from scenes.drawn import Count, Drawn, Range, Share, Signed, streams
from scenes.scene import Scene, SceneError

_TRIES_PER_OBJECT = 100
_TRIES_PER_LEADER = 2000  # for a rare trajectory
_TRIES_PER_LAYOUT = 50


@dataclasses.dataclass(frozen=True)
class Distracter(Drawn):
    """The scene and its parameters; "paper" marks values from smith2004.

    Frames count from 1, as in the paper.  Patch 0 is the distracter's, as in the paper; the others
    are the objects' own.  ``extras`` holds ``distracter_boxes [T, 4]``, NaN where there is no
    distracter, ``distracter_patch``, and ``object_patch``, the patch of object 1 itself.  Boxes are
    continuous; objects are drawn at the nearest whole pixel.

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

    name: ClassVar[str] = "distracter"
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

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        layout, looks, ground, pixels, patch_noise = streams(seed, 5)
        centres, distracter_centres = self._draw_layout(layout)
        textures, distracter_texture = self._paint_textures(looks)
        boxes, distracter_boxes = map(self._boxes_around, (centres, distracter_centres))
        background = grained(
            lambda rows, columns: with_noise(
                np.full((rows, columns, 3), self.background_mean), self.background_noise, ground
            ),
            self.frame_height,
            self.frame_width,
            self.background_grain,
        )
        frames = np.repeat(background[None], self.num_frames, axis=0)
        for frame, object_boxes, distracter_box in zip(
            frames, boxes, distracter_boxes, strict=True
        ):
            for box, texture in zip(object_boxes, textures, strict=True):
                _paste(frame, box, with_noise(texture, self.object_noise, pixels))
            if not np.isnan(distracter_box[0]):
                noisy = with_noise(distracter_texture, self.object_noise, pixels)
                _paste(frame, distracter_box, noisy)
        # Reference patches have noise, like the objects in the frames.
        own, *patches, distracter_patch = (
            with_noise(texture, self.object_noise, patch_noise)
            for texture in (*textures, distracter_texture)
        )
        return self.scene(
            seed,
            frames,
            boxes,
            [distracter_patch, *patches],
            distracter_boxes=distracter_boxes,
            distracter_patch=distracter_patch,
            object_patch=own,
        )

    @property
    def object_size(self) -> np.ndarray:
        """``[2]``: width and height of every object."""
        return np.array([self.object_width, self.object_height])

    def _draw_layout(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Centres of the objects ``[T, P, 2]`` and of the distracter ``[T, 2]``."""
        cells, room = self._grid()
        for _ in range(_TRIES_PER_LAYOUT):
            start = rng.permutation(cells)[: self.num_objects]
            start = start + self.start_jitter * room * rng.uniform(-1, 1, start.shape)
            layout = self._try_layout(start, rng)
            if layout is not None:
                return layout
        raise SceneError(
            f"scene {self.name!r}: {self.num_objects} objects of {self.object_width} x "
            f"{self.object_height} pixels do not stay apart and in view for {self.num_frames} "
            f"frames of {self.frame_width} x {self.frame_height}; take fewer or smaller objects, "
            "less motion_scale, separation, lead_distance or departure, or a larger frame"
        )

    def _grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres of the start cells ``[cells, 2]``, and the free space on each side of a cell."""
        aspect = self.frame_width / self.frame_height
        columns = int(np.ceil(np.sqrt(self.num_objects * aspect)))
        rows = int(np.ceil(self.num_objects / columns))
        cell = np.array([self.frame_width / columns, self.frame_height / rows])
        indices = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
        gap = self.separation + 2 * self.frame_margin
        return (indices + 0.5) * cell, np.maximum(cell - self.object_size - gap, 0) / 2

    def _try_layout(
        self, start: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Place the objects one by one, each clear of the previous ones; ``None`` if one fails."""
        for _ in range(_TRIES_PER_LEADER if self.departure > 0 else _TRIES_PER_OBJECT):
            leader = self._draw_trajectory(start[0], rng)
            distracter, travel, departure = self._lead_away(leader)
            moves = travel >= self.leader_travel and departure >= self.departure
            if moves and self._is_in_view(leader) and self._is_in_view(distracter):
                break
        else:
            return None
        placed = [leader]
        for position in start[1:]:
            for _ in range(_TRIES_PER_OBJECT):
                candidate = self._draw_trajectory(position, rng)
                if self._is_in_view(candidate) and all(
                    self._are_apart(candidate, other) for other in [*placed, distracter]
                ):
                    placed.append(candidate)
                    break
            else:
                return None
        return np.stack(placed, axis=1), distracter

    def _draw_trajectory(self, start: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """``[T, 2]``: second-order autoregressive motion (smith2004, section 2), from rest."""
        noise = self.motion_scale * rng.standard_normal((self.num_frames, 2))
        coordinates = []
        # One coordinate after the other, in plain floats: arrays of two would be ten times slower.
        for current, steps in zip(start.tolist(), noise.T.tolist(), strict=True):
            positions, previous = [], current
            for step in steps:
                positions.append(current)
                moved = current + self.momentum * (current - previous) + step
                previous, current = current, moved
            coordinates.append(positions)
        return np.stack(coordinates, axis=-1)

    def _lead_away(self, trajectory: np.ndarray) -> tuple[np.ndarray, float, float]:
        """The distracter's centres ``[T, 2]``, NaN while it is absent; where object 1 goes.

        The path is straight, back where object 1 came from, and ends at a given distance from it,
        so that every seed has the same gap between the correct and the wrong answer.

        Returns:
            The path, object 1's displacement meanwhile, and how far it ends from the path's end.
        """
        first = self.appear_frame - 1
        last = min(self.vanish_frame - 1, self.num_frames) - 1
        frames = np.arange(self.num_frames)
        is_shown = (frames >= first) & (frames <= last)
        if not is_shown.any():  # the sequence ends before the distracter appears
            return np.full_like(trajectory, np.nan), np.inf, np.inf
        moved = trajectory[last] - trajectory[first]
        travel = float(np.hypot(*moved))
        heading = -moved / travel if travel > 0 else np.array([1.0, 0.0])
        end = trajectory[last] + self.lead_distance * heading
        progress = (frames - first) / max(last - first, 1)
        path = trajectory[first] + progress[:, None] * (end - trajectory[first])
        departure = float(np.hypot(*(trajectory[-1] - path[last])))
        return np.where(is_shown[:, None], path, np.nan), travel, departure

    def _is_in_view(self, centres: np.ndarray) -> bool:
        """Whether the box stays in the frame; NaN frames are ignored."""
        reach = self.object_size / 2 + self.frame_margin
        return not np.any((centres < reach) | (centres > self.size - reach))

    def _are_apart(self, path: np.ndarray, other: np.ndarray) -> bool:
        """Whether the gap is kept in every frame; NaN frames are ignored."""
        reach = self.object_size + self.separation
        return not np.any(np.all(np.abs(path - other) < reach, axis=-1))

    def _boxes_around(self, centres: np.ndarray) -> np.ndarray:
        """``[..., 4]`` boxes around centres ``[..., 2]``; all NaN for a NaN centre."""
        sizes = np.where(np.isnan(centres), np.nan, self.object_size)
        return np.concatenate([centres - self.object_size / 2, sizes], axis=-1)

    def _paint_textures(self, rng: np.random.Generator) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the objects' textures ``[h, w, 3]`` float, and the distracter's.

        Each half shows two hues.  All hues differ between halves and between objects, so that
        histograms of the top and bottom halves distinguish all objects.
        """
        textures = []
        for number in range(self.num_objects):
            hue = number / self.num_objects
            is_accent = self._choose_cells(self.accent_share, rng)
            textures.append(self._paint(is_accent, (hue, hue + 0.45), (hue + 0.12, hue + 0.6)))
        is_foreign = self._choose_cells(1 - self.likeness, rng)
        foreign = self._paint(is_foreign, (0.25, 0.8), (0.25, 0.8))
        return textures, np.where(is_foreign[..., None], foreign, textures[0])

    def _choose_cells(self, share: float, rng: np.random.Generator) -> np.ndarray:
        """``[h, w]`` bool: the given share of the cells of each half, scattered at random."""
        top = self.object_height // 2
        halves = [
            scattered(share, height, self.object_width, self.cell_size, rng)
            for height in (top, self.object_height - top)
        ]
        return np.concatenate(halves)

    def _paint(
        self,
        is_accent: np.ndarray,
        main_hues: tuple[float, float],
        accent_hues: tuple[float, float],
    ) -> np.ndarray:
        """A patch ``[h, w, 3]`` in four hues (0 to 1): main and accent hues of top and bottom."""
        is_bottom = (np.arange(self.object_height) >= self.object_height // 2)[:, None]
        hues = np.where(
            is_accent,
            np.where(is_bottom, accent_hues[1], accent_hues[0]),
            np.where(is_bottom, main_hues[1], main_hues[0]),
        )
        return coloured(hues, self.saturation, self.brightness)


def _paste(picture: np.ndarray, box: np.ndarray, patch: np.ndarray) -> None:
    """Draw one object in place; the layout guarantees that it lies within the frame."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    height, width = patch.shape[:2]
    picture[top : top + height, left : left + width] = patch
