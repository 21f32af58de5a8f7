"""Shared by drawn scenes: textures, mosaics, noise, smooth paths, painted outlines, boxes."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import cv2
import numpy as np

from scenes.drawn import Drawn
from scenes.scene import Scene

#: Fractional bits of OpenCV coordinates.
_SHIFT = 4


def texture(rng: np.random.Generator, height: int, width: int, grain: float) -> np.ndarray:
    """Smooth noise ``[height, width]`` with mean 0 and standard deviation 1."""
    noise = cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), max(grain, 1e-3))
    return (noise - noise.mean()) / noise.std()


def grained(
    draw: Callable[[int, int], np.ndarray], height: int, width: int, grain: int
) -> np.ndarray:
    """A picture ``[height, width, ...]`` of squares with one value each.

    Args:
        draw: function of the numbers of rows and columns -> values of the squares.
        height: in pixels.
        width: in pixels.
        grain: side of the squares.
    """
    squares = draw(-(-height // grain), -(-width // grain))
    return squares.repeat(grain, axis=0).repeat(grain, axis=1)[:height, :width]


def scattered(
    share: float, height: int, width: int, cell_size: int, rng: np.random.Generator
) -> np.ndarray:
    """``[h, w]`` bool: a random share of the square cells."""

    def draw(rows: int, columns: int) -> np.ndarray:
        cells = np.arange(rows * columns) < round(share * rows * columns)
        return rng.permutation(cells).reshape(rows, columns)

    return grained(draw, height, width, cell_size)


def coloured(hues: np.ndarray, saturation: float, brightness: float) -> np.ndarray:
    """Picture ``[h, w, 3]``, float RGB from 0 to 255, of hues ``[h, w]`` in turns (period 1)."""
    hsv = np.empty((*hues.shape, 3), np.float32)
    hsv[..., 0] = 360 * (hues % 1)
    hsv[..., 1] = saturation
    hsv[..., 2] = brightness
    return 255.0 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)


def with_noise(picture: np.ndarray, scale: float, rng: np.random.Generator) -> np.ndarray:
    """Add normal noise to every channel of ``picture`` and round to uint8."""
    return as_pixels(picture + scale * rng.standard_normal(picture.shape))


def as_pixels(picture: np.ndarray) -> np.ndarray:
    """Round grey levels or colours to uint8."""
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def wandering(rng: np.random.Generator, num_frames: int, count: int, period: float) -> np.ndarray:
    """Smooth random paths ``[T, count]``, standard deviation about 1, zero in the first frame."""
    angle = 2 * np.pi * np.arange(num_frames)[:, None, None] / period
    speeds = rng.uniform(0.4, 1.2, (3, count))
    phases = rng.uniform(0, 2 * np.pi, (3, count))
    path = np.sin(angle * speeds + phases).sum(axis=1) * np.sqrt(2 / 3)
    return path - path[:1]


def noisy(picture: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Convert a grey picture ``[H, W]`` to uint8 RGB ``[H, W, 3]`` with noise on every pixel."""
    return np.repeat(with_noise(picture, noise, rng)[..., None], 3, axis=-1)


def painted(
    grounds: Iterable[np.ndarray],
    outlines: np.ndarray,
    order: Sequence[int],
    paint: Callable[[np.ndarray, np.ndarray], object],
    noise: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Frames ``[T, H, W, 3]`` uint8 of outlines on grey grounds.

    Args:
        grounds: ``[H, W]`` of each frame.
        outlines: ``[T, P, S, 2]``.
        order: in which targets are painted, the farthest first.
        paint: paints an outline into a picture, in place.
        noise: standard deviation of every pixel.
        rng: stream of the noise.
    """
    frames = []
    for ground, shapes in zip(grounds, outlines, strict=True):
        picture = ground.copy()
        for target in order:
            paint(picture, shapes[target])
        frames.append(noisy(picture, noise, rng))
    return np.stack(frames)


def paint_inside(picture: np.ndarray, outline: np.ndarray, colour: float | np.ndarray) -> None:
    """Fill a closed outline ``[S, 2]`` in a float picture ``[H, W]``, antialiased, in place.

    Args:
        picture: grey levels.
        outline: in continuous pixels.
        colour: a grey level, or a picture of the same size.
    """

    def fill(share: np.ndarray, points: np.ndarray) -> None:
        cv2.fillPoly(share, [points], 255, cv2.LINE_AA, _SHIFT)

    _blend(picture, outline, colour, 2, fill)


def paint_body(
    picture: np.ndarray, outline: np.ndarray, colour: float | np.ndarray, seam: float
) -> None:
    """Fill a closed outline as ``paint_inside`` does, and draw a seam around it, 2 pixels wide.

    Without a seam, two bodies of equal grey would have no edge between them.
    """
    paint_inside(picture, outline, colour)
    paint_line(picture, np.concatenate([outline, outline[:1]]), seam, 2)


def paint_line(picture: np.ndarray, line: np.ndarray, grey: float, width: int) -> None:
    """Draw an open line ``[S, 2]`` into a float picture ``[H, W]``, in place."""

    def draw(share: np.ndarray, points: np.ndarray) -> None:
        cv2.polylines(share, [points], False, 255, width, cv2.LINE_AA, _SHIFT)

    _blend(picture, line, grey, width + 2, draw)


def _blend(
    picture: np.ndarray,
    points: np.ndarray,
    colour: Any,
    margin: int,
    draw: Callable[[np.ndarray, np.ndarray], object],
) -> None:
    """Blend a colour into the part of a picture that ``draw`` covers, in place."""
    height, width = picture.shape
    left, top = np.clip(np.floor(points.min(axis=0)).astype(int) - margin, 0, (width, height))
    right, bottom = np.clip(np.ceil(points.max(axis=0)).astype(int) + margin, 0, (width, height))
    if right <= left or bottom <= top:
        return
    part = picture[top:bottom, left:right]
    share = np.zeros(part.shape, np.uint8)
    # OpenCV's pixel (0, 0) has its centre at (0, 0), ours at (.5, .5).
    fixed = np.rint((points - (left + 0.5, top + 0.5)) * 2**_SHIFT).astype(np.int32)
    draw(share, fixed)
    if np.ndim(colour):
        colour = colour[top:bottom, left:right]
    part += (share / 255.0) * (colour - part)


def boxes_around(outlines: np.ndarray) -> np.ndarray:
    """Boxes x, y, w, h ``[..., 4]`` around outlines ``[..., S, 2]``."""
    low, high = outlines.min(axis=-2), outlines.max(axis=-2)
    return np.concatenate([low, high - low], axis=-1)


def scene_of_outlines(
    drawn: Drawn, seed: int, frames: np.ndarray, outlines: np.ndarray, **extras: Any
) -> Scene:
    """A scene with boxes around the outlines and patches from the first frame."""
    drawn.check_in_view(outlines)
    boxes, patches = boxes_around(outlines), []
    for x, y, w, h in boxes[0]:
        rows, columns = slice(int(y), int(np.ceil(y + h))), slice(int(x), int(np.ceil(x + w)))
        patches.append(frames[0, rows, columns])
    return drawn.scene(seed, frames, boxes, patches, outlines=outlines, **extras)
