"""Draws tracked points and their trails."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike

from jaxpf.media.overlay import DARK, Label, draw_labels, shades_of

_SHIFT = 3  # fractional bits of OpenCV coordinates


def draw_points(
    frame: np.ndarray,
    places: ArrayLike,
    *,
    trails: ArrayLike | None = None,
    hidden: ArrayLike | None = None,
    colours: ArrayLike | None = None,
    names: Sequence[str] | None = None,
) -> np.ndarray:
    """Draw points on a copy of a frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        places: [P, 2], x and y in pixels; non-finite ones are skipped.
        trails: [L, P, 2], positions in the previous frames, the latest last.
        hidden: bool [P]: these are drawn hollow.
        colours: uint8 RGB [P, 3]; by default ``jaxpf.media.object_colours``.
        names: [P], written beside the points, or in a corner where points are too dense.
    """
    picture = np.ascontiguousarray(frame).copy()
    places = np.asarray(places, float)
    count = len(places)
    shades = shades_of(count, colours)
    hollow = np.zeros(count, bool) if hidden is None else np.asarray(hidden)
    radius = max(4.0, min(picture.shape[:2]) / 120)
    line = max(1, round(radius / 4))
    # Trails first, so that they hide no point.
    if trails is not None:
        for point, colour in enumerate(shades):
            trail = np.asarray(trails, float)[:, point]
            trail = np.round(trail[np.isfinite(trail).all(axis=1)] * 2**_SHIFT - 2 ** (_SHIFT - 1))
            whole = [trail.astype(np.int32)]
            cv2.polylines(picture, whole, False, colour, line, cv2.LINE_AA, _SHIFT)
    for point, colour in enumerate(shades):
        x, y = places[point]
        if not np.isfinite(x + y):
            continue
        # OpenCV counts from a pixel's centre.
        at = tuple(np.round((np.clip([x, y], -1e4, 1e5) - 0.5) * 2**_SHIFT).astype(int).tolist())
        size = round(radius * 2**_SHIFT)
        # A dark rim keeps every colour visible on every background and on its own particles.
        cv2.circle(picture, at, size, DARK, 3 * line, cv2.LINE_AA, _SHIFT)
        cv2.circle(picture, at, size, colour, line if hollow[point] else -1, cv2.LINE_AA, _SHIFT)
    if names is not None:
        reach = radius + 2 * line + 1  # with the rim
        labels = [
            Label.around(f"{name}", place - reach, place + reach, colour)
            for name, place, colour in zip(names, np.clip(places, -1e4, 1e5), shades, strict=True)
            if np.isfinite(place).all()
        ]
        draw_labels(picture, labels, beside=True)
    return picture
