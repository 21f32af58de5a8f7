"""Drawing tracked points: where they are, where they came from, and their particles."""

import cv2
import numpy as np
from numpy.typing import ArrayLike

from jaxpf.media.overlay import object_colours

_SHIFT = 3  # bits of a fraction of a pixel, for OpenCV


def draw_points(
    frame: np.ndarray,
    places: ArrayLike,
    *,
    trails: ArrayLike | None = None,
    particles: ArrayLike | None = None,
    hidden: ArrayLike | None = None,
    colours: ArrayLike | None = None,
    radius: float = 4.0,
) -> np.ndarray:
    """A copy of a frame with points on it.

    Args:
        frame: uint8 RGB [H, W, 3].
        places: [P, 2], x and y in pixels; those that are not finite are not drawn.
        trails: [L, P, 2], places of the frames before, the latest last.
        particles: [K, P, 2].
        hidden: bool [P]: these are drawn hollow.
        colours: uint8 RGB [P, 3]; by default ``jaxpf.overlay.object_colours``.
        radius: of a point, pixels.
    """
    picture = np.ascontiguousarray(frame).copy()
    places = np.asarray(places, float)
    chosen = object_colours(len(places)) if colours is None else np.asarray(colours)
    hollow = np.zeros(len(places), bool) if hidden is None else np.asarray(hidden, bool)
    for point, colour in enumerate(tuple(map(int, each)) for each in chosen):
        if trails is not None:
            line = np.asarray(trails, float)[:, point]
            line = np.round(line[np.isfinite(line).all(axis=1)] * 2**_SHIFT - 2 ** (_SHIFT - 1))
            cv2.polylines(picture, [line.astype(np.int32)], False, colour, 1, cv2.LINE_AA, _SHIFT)
        if particles is not None:
            for x, y in np.asarray(particles, float)[:, point]:
                if np.isfinite(x + y):
                    cv2.circle(picture, _centre(x, y), 2**_SHIFT, colour, -1, cv2.LINE_AA, _SHIFT)
        x, y = places[point]
        if np.isfinite(x + y):
            size = round(radius * 2**_SHIFT)
            thickness = 1 if hollow[point] else -1
            cv2.circle(picture, _centre(x, y), size, colour, thickness, cv2.LINE_AA, _SHIFT)
    return picture


def _centre(x: float, y: float) -> tuple[int, int]:
    # A pixel's middle lies half a pixel from its number.
    x, y = np.clip([x, y], -1e4, 1e5)
    return round((x - 0.5) * 2**_SHIFT), round((y - 0.5) * 2**_SHIFT)
