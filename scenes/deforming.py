"""Textured deformable bodies: rendering, and the positions of their points.

A body is a picture in its own coordinates, with (0, 0) in the centre, in pixels at scale 1.  A pose
first bends it, q -> q + bend(q), and then rotates, scales and moves it.  Points follow exactly.
Rendering needs the inverse, found by fixed-point iteration, so bends must be smooth, with slopes
below 1.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import ClassVar

import cv2
import numpy as np

from scenes.drawn import Drawn, streams
from scenes.scene import Scene

Bend = Callable[[np.ndarray], np.ndarray]

#: Side of the windows used as boxes and patches of points (eskil2014).
WINDOW = 21
_ITERATIONS = 5
_STEP = 4


@dataclasses.dataclass(frozen=True, eq=False)
class Body:
    """A picture with a silhouette.

    Attributes:
        picture: float32 [h, w, 3], 0 to 255.
        alpha: float32 [h, w], 0 outside and 1 inside.
    """

    picture: np.ndarray
    alpha: np.ndarray


class Sketch:
    """A body while it is drawn, pixel by pixel.

    Attributes:
        picture: float32 [h, w, 3], also outside its silhouette.
        alpha: uint8 [h, w], the silhouette.
        middle: pixel of the body's origin, [2].
    """

    def __init__(self, texture: np.ndarray):
        """Begin with a texture [h, w, 3] without a silhouette."""
        height, width = texture.shape[:2]
        self.picture = np.ascontiguousarray(np.clip(texture, 0, 255).astype(np.float32))
        self.alpha = np.zeros((height, width), np.uint8)
        self.middle = np.array([width // 2, height // 2])

    def limb(self, start, end, thickness, colour=None, wider=0) -> None:
        """Add a thick line between two positions; a colour covers that many pixels more."""
        first, last = ([int(value) for value in self.middle + place] for place in (start, end))
        cv2.line(self.alpha, first, last, (255,), thickness, cv2.LINE_AA)
        if colour is not None:
            cv2.line(self.picture, first, last, colour, thickness + wider, cv2.LINE_AA)

    def body(self) -> Body:
        """The finished body."""
        return Body(self.picture, self.alpha.astype(np.float32) / 255)


@dataclasses.dataclass(frozen=True, eq=False)
class Pose:
    """Position and bend of a body.

    Attributes:
        x: of its centre, pixels.
        y: of its centre, pixels.
        scale: relative to the picture.
        angle: radians, clockwise in the image.
        bend: displacements [..., 2] of positions [..., 2], both in body coordinates.
    """

    x: float
    y: float
    scale: float = 1.0
    angle: float = 0.0
    bend: Bend = np.zeros_like

    def matrix(self) -> np.ndarray:
        """[2, 2], from the bent body to the image."""
        cosine, sine = self.scale * np.cos(self.angle), self.scale * np.sin(self.angle)
        return np.array([[cosine, -sine], [sine, cosine]])

    def to_image(self, places: np.ndarray) -> np.ndarray:
        """Convert body coordinates [..., 2] to image coordinates [..., 2]."""
        places = np.asarray(places, float)
        return (places + self.bend(places)) @ self.matrix().T + [self.x, self.y]

    def to_body(self, places: np.ndarray) -> np.ndarray:
        """Invert ``to_image``."""
        target = (np.asarray(places, float) - [self.x, self.y]) @ np.linalg.inv(self.matrix()).T
        unbent = target
        for _ in range(_ITERATIONS):
            unbent = target - self.bend(unbent)
        return unbent


def bumps(*each: tuple[tuple[float, float], float, tuple[float, float]]) -> Bend:
    """Return the sum of Gaussian bumps, each (centre, reach, displacement)."""

    def bend(places: np.ndarray) -> np.ndarray:
        x, y = places[..., 0], places[..., 1]
        moved = np.zeros_like(places)
        for centre, reach, displacement in each:
            squares = (x - centre[0]) ** 2 + (y - centre[1]) ** 2
            share = np.exp(-squares / (2 * reach**2))
            moved[..., 0] += share * displacement[0]
            moved[..., 1] += share * displacement[1]
        return moved

    return bend


def draw(frame: np.ndarray, body: Body, pose: Pose) -> None:
    """Paint a body onto a float32 frame [H, W, 3], in place."""
    height, width = body.alpha.shape
    reach = 0.75 * pose.scale * np.hypot(height, width)
    left, right = (int(np.clip(pose.x + r, 0, frame.shape[1])) for r in (-reach, reach))
    top, bottom = (int(np.clip(pose.y + r, 0, frame.shape[0])) for r in (-reach, reach))
    if right <= left or bottom <= top:
        return
    # Bends are smooth: compute the inverse on a coarse grid and interpolate.
    coarse = [
        np.arange(low, high + _STEP, _STEP) + 0.5 for low, high in ((left, right), (top, bottom))
    ]
    places = pose.to_body(np.stack(np.meshgrid(*coarse), -1))
    # OpenCV's pixel centres have integer coordinates.
    places = (places + np.array([width - 1, height - 1]) / 2).astype(np.float32)
    across = np.arange(right - left, dtype=np.float32) / _STEP
    down = np.arange(bottom - top, dtype=np.float32) / _STEP
    x, y = cv2.split(cv2.remap(places, *np.meshgrid(across, down), cv2.INTER_LINEAR))
    picture = cv2.remap(body.picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    alpha = cv2.remap(body.alpha, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)[..., None]
    region = frame[top:bottom, left:right]
    region += alpha * (picture - region)


def covers(body: Body, pose: Pose, places: np.ndarray) -> np.ndarray:
    """Whether a body covers positions [..., 2] of the image."""
    height, width = body.alpha.shape
    column, row = np.moveaxis(np.floor(pose.to_body(places) + np.array([width, height]) / 2), -1, 0)
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    row, column = (np.where(inside, value, 0).astype(int) for value in (row, column))
    return inside & (body.alpha[row, column] > 0.5)


def noise(rng: np.random.Generator, shape: tuple[int, int], grain: float, channels: int = 3):
    """Smooth noise, float32 [h, w, channels], standard deviation 1, grain size in pixels."""
    small = [max(2, int(np.ceil(side / grain)) + 3) for side in shape]
    values = rng.normal(size=(*small, channels)).astype(np.float32)
    large = cv2.resize(values, None, fx=grain, fy=grain, interpolation=cv2.INTER_CUBIC)
    large = large.reshape(*large.shape[:2], channels)[: shape[0], : shape[1]]
    return large / large.std()


class Film:
    """Collects the frames of a scene as uint8, with camera noise."""

    def __init__(self, rng: np.random.Generator, height: int, width: int, pixel_noise: float):
        """Start without frames; ``pixel_noise`` is a standard deviation in grey levels."""
        self.frames: list[np.ndarray] = []
        self._rng = rng
        shape = (2 * height, 2 * width, 3)
        self._noise = (pixel_noise * rng.standard_normal(shape, np.float32)).astype(np.float32)

    def add(self, frame: np.ndarray) -> None:
        """Add a float32 frame [H, W, 3]."""
        height, width = frame.shape[:2]
        top, left = self._rng.integers(0, height), self._rng.integers(0, width)
        noisy = frame + self._noise[top : top + height, left : left + width]
        self.frames.append(np.clip(noisy + 0.5, 0, 255).astype(np.uint8))


#: A picture without camera noise, float32 [H, W, 3]; points [P, 2] in pixels; whether they are
#: visible, bool [P]; length of the body in pixels.
Shot = tuple[np.ndarray, np.ndarray, np.ndarray, float]


@dataclasses.dataclass(frozen=True)
class Points(Drawn):
    """A scene of points on deforming bodies; boxes and patches are windows around the points.

    ``extras`` has ``points`` [T, P, 2] in pixels, ``visible`` bool [T, P], ``point_names`` and
    ``body_length`` [T] in pixels.

    Attributes:
        pixel_noise: standard deviation of the camera noise.
    """

    pixel_noise: float = 4.0

    #: Name of a point -> its position in body coordinates.
    points: ClassVar[Mapping[str, tuple[float, float]]]

    def shots(self, look: np.random.Generator, path: np.random.Generator) -> Iterator[Shot]:
        """The frames, from a stream for appearance and one for motion."""
        raise NotImplementedError

    def in_view(self, places: np.ndarray) -> np.ndarray:
        """Whether positions [..., 2] lie in the frame."""
        return np.all((places >= 0) & (places < self.size), axis=-1)

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        look, path, camera = streams(seed, 3)
        film, truth = Film(camera, self.frame_height, self.frame_width, self.pixel_noise), []
        for picture, *of_frame in self.shots(look, path):
            film.add(picture)
            truth.append(of_frame)
        points, visible, length = (np.array(each) for each in zip(*truth, strict=True))
        boxes = np.concatenate([points - WINDOW / 2, np.full_like(points, WINDOW)], axis=-1)
        starts_inside = bool(self.in_view(points[0]).all())
        self.require("frame_width", starts_inside, "is too small for the body")
        padded = np.pad(film.frames[0], ((WINDOW, WINDOW), (WINDOW, WINDOW), (0, 0)))
        patches = []
        for column, row in points[0].astype(int) + WINDOW - WINDOW // 2:
            patches.append(padded[row : row + WINDOW, column : column + WINDOW].copy())
        return self.scene(
            seed,
            np.stack(film.frames),
            boxes,
            patches,
            points=points,
            visible=visible,
            point_names=tuple(self.points),
            body_length=length,
        )
