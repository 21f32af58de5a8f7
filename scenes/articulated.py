"""The synthetic test of Gonzales, Dubuisson and Nguyen (gonzales2011, section 4): moving parts.

An object of P rectangles, a centre and two arms, moves and deforms.  The paper specifies the
numbers of parts and of frames and names the motions (weak; strong at the beginning; "very strong
and erratic" throughout); its sequences were never published.  Everything else is our choice.
"""

import dataclasses
from typing import Annotated, ClassVar, Literal

import numpy as np

from scenes.drawing import boxes_around, coloured, scattered, with_noise
from scenes.drawn import Above0, Count, Drawn, Range, Share, Signed, streams
from scenes.scene import Scene


@dataclasses.dataclass(frozen=True)
class Articulated(Drawn):
    """The scene and its parameters; "paper" marks values from gonzales2011.

    Part 0 is the centre; odd parts form the left arm and even parts the right, from the centre
    outwards.  ``boxes`` are the upright bounding boxes.  ``extras`` holds

    * ``corners [T, P, 4, 2]``: top left, top right, bottom right and bottom left corner of every
      part, as named at angle 0, in pixels;
    * ``poses [T, P, 3]``: x, y of the part's centre and its angle in radians, clockwise in the
      image, continuous in time;
    * ``parents``, a tuple ``[P]``, -1 for the centre;
    * ``parent_anchors [P, 2]`` and ``part_anchors [P, 2]``: the position of a part's joint in its
      parent's coordinates and in its own (origin at the centre, axes turned with the part).

    Attributes:
        num_parts: P, an odd number: the centre and two arms of (P - 1) / 2 parts each
            (paper: 3, 5, 7, 9, 11).
        num_frames: length of the sequence (paper: 300).
        motion: "smooth" moves every coordinate sinusoidally; "strong_start" is the same path,
            traversed faster at the beginning; "erratic" moves every coordinate between random
            targets, each on its own schedule (the paper's three kinds of sequences).
        part_length: length of an arm's part, along the arm.
        inset: distance of a joint from the ends of the two parts that it connects, inside both, so
            that no gap opens as they rotate.
        tilt: maximum rotation of the centre, degrees.
        swing: maximum angle between a part and its parent, degrees.
        period_spread: every coordinate's period is drawn from (1 -+ this) times the mean.
        strong_factor: speed factor there; it falls to 1 within the last quarter of
            ``strong_frames``.
        erratic_longest: maximum time from one target to the next.
        cell_size: side of the square cells of which parts are mosaics.
        accent_share: share of a part's cells that have its second colour.
        saturation: saturation of the parts' colours, 0 to 1.
        brightness: value (in HSV) of the parts' colours, 0 to 1.
        object_noise: standard deviation of the normal noise on the parts' pixels, redrawn in every
            frame, and once for the reference patches.
        background_mean: mean of the background.
        background_noise: standard deviation of the background's normal noise, independent in
            each channel and pixel; one background for all frames.
    """

    name: ClassVar[str] = "articulated"
    num_parts: Count = 7
    num_frames: Count = 300
    motion: Literal["smooth", "strong_start", "erratic"] = "smooth"
    frame_width: Count = 400
    frame_height: Count = 300
    part_length: Count = 28
    inset: float = 2.5
    tilt: float = 12.0
    swing: float = 26.0
    period_spread: Annotated[float, Range(0, 0.99)] = 0.3
    strong_factor: Above0 = 3.0
    erratic_longest: int = 12
    cell_size: Count = 4
    accent_share: Share = 0.3
    saturation: Share = 0.8
    brightness: Share = 0.8
    object_noise: float = 10.0
    background_mean: Signed = 128.0
    background_noise: float = 45.0

    centre_width: ClassVar[int] = 34
    centre_height: ClassVar[int] = 30
    part_width: ClassVar[int] = 16  # across the arm
    travel_x: ClassVar[float] = 45.0  # farthest from the middle of the frame
    travel_y: ClassVar[float] = 30.0  # the same, vertically
    travel_period: ClassVar[float] = 130.0  # mean, in frames
    swing_period: ClassVar[float] = 90.0  # mean, also of the tilt
    strong_frames: ClassVar[int] = 60  # length of the beginning of "strong_start"
    erratic_shortest: ClassVar[int] = 4  # shortest time between targets

    def __post_init__(self) -> None:
        super().__post_init__()
        odd, longest = self.num_parts % 2 == 1, self.erratic_longest >= self.erratic_shortest
        narrow = min(self.part_length, self.centre_width) / 2
        self.require("num_parts", odd, "must be odd: a centre and two arms of equal length")
        self.require("erratic_longest", longest, "must be at least erratic_shortest")
        self.require("inset", self.inset <= narrow, f"must be at most {narrow}, half a part")

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        motion, looks, ground, pixels, patches = streams(seed, 5)
        parents = tuple(max(part - 2, 0) if part else -1 for part in range(self.num_parts))
        sizes = np.full((self.num_parts, 2), (self.part_length, self.part_width))
        sizes[0] = self.centre_width, self.centre_height
        joints = self._joints(parents, sizes)
        poses = _place(self._draw_motion(motion), parents, *joints)
        poses[..., :2] += self.size / 2
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        corners = poses[..., None, :2] + _turned(signs * sizes[:, None] / 2, poses[..., None, 2])
        self.check_in_view(corners)
        textures = self._paint_textures(sizes, looks)
        return self.scene(
            seed,
            self._draw_frames(poses, corners, textures, ground, pixels),
            boxes_around(corners),
            # Reference patches have noise, like the parts in the frames.
            [with_noise(texture, self.object_noise, patches) for texture in textures],
            corners=corners,
            poses=poses,
            parents=parents,
            parent_anchors=joints[0],
            part_anchors=joints[1],
        )

    def _joints(self, parents: tuple[int, ...], sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of each part's joint in its parent's coordinates and its own, ``[P, 2]``."""
        parent_anchors, part_anchors = np.zeros(sizes.shape), np.zeros(sizes.shape)
        for part, parent in enumerate(parents):
            if parent >= 0:
                outwards = -1 if part % 2 == 1 else 1
                parent_anchors[part, 0] = outwards * (sizes[parent, 0] / 2 - self.inset)
                part_anchors[part, 0] = -outwards * (sizes[part, 0] / 2 - self.inset)
        return parent_anchors, part_anchors

    def _draw_motion(self, rng: np.random.Generator) -> np.ndarray:
        """``[T, P + 2]``: x and y of the centre, its angle, and the angle of every other joint."""
        turns = np.deg2rad([self.tilt, *[self.swing] * (self.num_parts - 1)])
        largest = np.array([self.travel_x, self.travel_y, *turns])
        if self.motion == "erratic":
            return largest * np.stack([self._draw_erratic(rng) for _ in largest], axis=1)
        periods = np.full(largest.shape, self.swing_period)
        periods[:2] = self.travel_period
        periods *= rng.uniform(1 - self.period_spread, 1 + self.period_spread, periods.shape)
        phases = rng.uniform(0, 2 * np.pi, periods.shape)
        clock = np.concatenate([[0.0], np.cumsum(self._speed())])[:-1]
        return largest * np.sin(2 * np.pi * clock[:, None] / periods + phases)

    def _speed(self) -> np.ndarray:
        """``[T]``: how far the clock of the smooth motion advances in each frame."""
        if self.motion != "strong_start":
            return np.ones(self.num_frames)
        left = self.strong_frames - np.arange(self.num_frames)
        share = np.clip(left / max(self.strong_frames / 4, 1), 0, 1)
        return 1 + (self.strong_factor - 1) * share

    def _draw_erratic(self, rng: np.random.Generator) -> np.ndarray:
        """``[T]`` in -1 to 1: moves between random targets, at rest in each."""
        track = np.empty(self.num_frames)
        at, start = 0, rng.uniform(-1, 1)
        while at < len(track):
            steps = int(rng.integers(self.erratic_shortest, self.erratic_longest + 1))
            target = rng.uniform(-1, 1)
            share = np.arange(steps)[: len(track) - at] / steps
            ease = share**2 * (3 - 2 * share)
            track[at : at + steps] = start + (target - start) * ease
            at, start = at + steps, target
        return track

    def _paint_textures(self, sizes: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
        """Textures ``[h, w, 3]`` float: mosaics of two hues, different for every part."""
        textures = []
        for part, (width, height) in enumerate(sizes):
            is_accent = scattered(self.accent_share, height, width, self.cell_size, rng)
            hues = part / self.num_parts + np.where(is_accent, 0.12, 0.0)
            textures.append(coloured(hues, self.saturation, self.brightness))
        return textures

    def _draw_frames(
        self,
        poses: np.ndarray,
        corners: np.ndarray,
        textures: list[np.ndarray],
        ground: np.random.Generator,
        pixels: np.random.Generator,
    ) -> np.ndarray:
        """``[T, H, W, 3]`` uint8: the background, parts from the arms' ends to the centre."""
        mean = np.full((self.frame_height, self.frame_width, 3), self.background_mean)
        background = with_noise(mean, self.background_noise, ground)
        frames = np.repeat(background[None], self.num_frames, axis=0)
        for frame, pose, corner in zip(frames, poses, corners, strict=True):
            for part in reversed(range(len(textures))):
                self._paste(frame, pose[part], corner[part], textures[part], pixels)
        return frames

    def _paste(
        self,
        picture: np.ndarray,
        pose: np.ndarray,
        corners: np.ndarray,
        texture: np.ndarray,
        rng: np.random.Generator,
    ) -> None:
        """Draw one part in place: a pixel whose centre lies in it shows the texture there."""
        left, top = np.floor(corners.min(axis=0)).astype(int).clip(0)
        right, bottom = np.ceil(corners.max(axis=0)).astype(int)
        window = picture[top:bottom, left:right]
        rows, columns = np.mgrid[top : top + len(window), left : left + window.shape[1]]
        offsets = np.stack([columns, rows], axis=-1) + 0.5 - pose[:2]
        height, width = texture.shape[:2]
        inner = _turned(offsets, -pose[2]) + np.array([width, height]) / 2
        column, row = np.floor(inner).astype(int).transpose(2, 0, 1)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        shown = texture[row[inside], column[inside]]
        window[inside] = with_noise(shown, self.object_noise, rng)


def _place(
    motion: np.ndarray,
    parents: tuple[int, ...],
    parent_anchors: np.ndarray,
    part_anchors: np.ndarray,
) -> np.ndarray:
    """Poses ``[T, P, 3]`` down the tree; the centre is placed relative to the origin."""
    poses = np.empty((len(motion), len(parents), 3))
    for part, parent in enumerate(parents):
        if parent < 0:
            poses[:, part] = motion[:, :3]
            continue
        angle = poses[:, parent, 2] + motion[:, part + 2]
        joint = poses[:, parent, :2] + _turned(parent_anchors[part], poses[:, parent, 2])
        poses[:, part, :2] = joint - _turned(part_anchors[part], angle)
        poses[:, part, 2] = angle
    return poses


def _turned(vectors: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rotate vectors ``[..., 2]`` by angles ``[...]`` in radians, clockwise in the image."""
    x, y = vectors[..., 0], vectors[..., 1]
    cosine, sine = np.cos(angles), np.sin(angles)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
