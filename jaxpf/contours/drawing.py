"""Draws the contours of particles; occluded parts are dark and dashed."""

import cv2
import numpy as np
from numpy.typing import ArrayLike

from jaxpf.media.overlay import line_thickness, object_colours

_SHIFT = 4  # fractional bits of OpenCV coordinates
#: Opacity of particles.
_OPACITY = 0.6
#: Minimum weight of a drawn particle, relative to the largest.
_LEAST = 0.02
#: Maximum width of a particle's line, relative to the thinnest.
_WIDEST = 4


def draw_contour_particles(
    frame: np.ndarray,
    lines: ArrayLike,
    weights: ArrayLike,
    hidden: ArrayLike | None = None,
    colours: np.ndarray | None = None,
) -> np.ndarray:
    """Draw the contours of particles on a copy of a frame; larger weights get wider lines.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        lines: ``[n, P, V, 2]``, points in pixels; a closed contour ends with its first point.
        weights: ``[n]``, at least 0.
        hidden: bool ``[n, P, V]``, points behind another target: dark and dashed.
        colours: uint8 RGB ``[P, 3]``; ``object_colours(P)`` by default.
    """
    frame = np.ascontiguousarray(frame)
    picture, lines = frame.copy(), np.asarray(lines, float)
    weights = np.asarray(weights, float)
    colours = object_colours(lines.shape[1]) if colours is None else np.asarray(colours)
    shown = np.zeros(lines.shape[:3], bool) if hidden is None else np.asarray(hidden)
    widths = 1 + (_WIDEST - 1) * weights / max(weights.max(initial=0.0), 1e-30)
    thinnest = max(line_thickness(frame) // 2, 1)
    drawn = np.flatnonzero(weights >= _LEAST * weights.max(initial=0.0))
    for number in drawn[np.argsort(weights[drawn])]:
        for line, dark, colour in zip(lines[number], shown[number], colours, strict=True):
            if np.isfinite(line).all():
                width = round(thinnest * widths[number])
                _draw(picture, line, dark, tuple(map(int, colour)), width)
    return cv2.addWeighted(picture, _OPACITY, frame, 1 - _OPACITY, 0)


def _draw(picture, line, dashed, colour, thickness) -> None:
    """Draw a line: solid where visible; else dashed (two of four pieces) and darker."""
    size = np.array(picture.shape[1::-1])
    # OpenCV counts from a pixel's centre; clip, because it overflows far outside the frame.
    points = np.round((np.clip(line, -size, 2 * size) - 0.5) * 2**_SHIFT).astype(np.int32)
    dark = tuple(level // 2 for level in colour)
    apart = dashed[:-1] | dashed[1:]
    begin = 0
    for end in range(1, len(apart) + 1):
        if end < len(apart) and apart[end] == apart[begin]:
            continue
        if apart[begin]:
            pieces = [points[k : min(k + 2, end) + 1] for k in range(begin, end, 4)]
        else:
            pieces = [points[begin : end + 1]]
        shade = dark if apart[begin] else colour
        cv2.polylines(picture, pieces, False, shade, thickness, cv2.LINE_AA, _SHIFT)
        begin = end
