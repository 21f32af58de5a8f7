"""Draws boxes, particles and a coordinate grid on frames.

Every function takes a uint8 RGB frame [H, W, 3] and returns a new one.  Coordinates are
continuous pixels: pixel (0, 0) is the square [0, 1) x [0, 1).
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

_FONT = cv2.FONT_HERSHEY_SIMPLEX
#: Colour of rims, which keep lines visible on any background.
DARK = (20, 20, 20)
_LIGHT = (255, 255, 255)
#: Opacity of faint lines.
_FAINT = 0.5
#: Smallest legible font scale.
_SMALLEST_FONT = 0.33
#: Maximum number of small objects whose names are listed.
_MOST_LISTED = 12

# Okabe and Ito, "Color universal design" (2008), without black; the order keeps neighbours far
# apart for every common kind of colour vision.
_PALETTE = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
)


def object_colours(num_objects: int) -> np.ndarray:
    """Return colours that people with any common kind of colour vision can distinguish.

    Seven are distinct; from the eighth object on they repeat, first lighter, then darker, and
    only the labels distinguish the objects.

    Returns:
        uint8 RGB [num_objects, 3].
    """
    palette = np.asarray(_PALETTE, np.float64)
    rounds = (palette, palette + 0.55 * (255 - palette), 0.55 * palette)
    colours = np.concatenate(rounds)[np.arange(num_objects) % (3 * len(palette))]
    return np.round(colours).astype(np.uint8)


def draw_boxes(
    frame: np.ndarray,
    boxes: np.ndarray,
    ids: np.ndarray | list[int] | None = None,
    colours: np.ndarray | None = None,
    lost: np.ndarray | None = None,
    doubtful: np.ndarray | None = None,
) -> np.ndarray:
    """Draw labelled boxes on a copy of the frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        boxes: x, y, w, h in pixels [P, 4]; a box that is not finite is skipped.
        ids: the labels [P]; by default numbers, from 1.
        colours: uint8 RGB [P, 3]; ``object_colours(P)`` by default.
        lost: bool [P]; a lost object's box is dashed and its label says "lost".
        doubtful: bool [P]; a probably lost object's box is dashed and faint, and its label has a
            question mark.
    """
    frame = frame.copy()
    boxes = np.asarray(boxes, np.float64).reshape(-1, 4)
    names = range(1, len(boxes) + 1) if ids is None else ids
    colours = object_colours(len(boxes)) if colours is None else np.asarray(colours)
    nobody = np.zeros(len(boxes), bool)
    lost = nobody if lost is None else np.asarray(lost, bool)
    doubtful = nobody if doubtful is None else np.asarray(doubtful, bool) & ~lost
    shown = np.isfinite(boxes).all(axis=1)
    if (shown & doubtful).any():
        faint = frame.copy()
        for index in np.flatnonzero(shown & doubtful):
            _draw_box(faint, boxes[index], colours[index], True)
        cv2.addWeighted(faint, _FAINT, frame, 1 - _FAINT, 0, dst=frame)
    for index in np.flatnonzero(shown & ~doubtful):
        _draw_box(frame, boxes[index], colours[index], lost[index])
    # Labels come last so that no box crosses one.
    labels = []
    for index in np.flatnonzero(shown):
        left, top, right, bottom = _corners(boxes[index], frame)
        mark = " lost" if lost[index] else " ?" if doubtful[index] else ""
        colour = _as_colour(colours[index])
        labels.append(Label(f"{names[index]}{mark}", left, top, right + 1, bottom + 1, colour))
    draw_labels(frame, labels)
    return frame


def _draw_box(frame: np.ndarray, box: np.ndarray, colour: np.ndarray, dashed: bool) -> None:
    left, top, right, bottom = _corners(box, frame)
    thickness = line_thickness(frame)
    rim = 2 if min(frame.shape[:2]) >= 240 else 1
    # A dark rim keeps every colour visible on every background.
    for line, width in ((DARK, thickness + rim), (_as_colour(colour), thickness)):
        if dashed:
            _dashed_rectangle(frame, (left, top), (right, bottom), line, width)
        else:
            cv2.rectangle(frame, (left, top), (right, bottom), line, width)


def draw_rectangles(
    frame: np.ndarray,
    corners: np.ndarray,
    names: np.ndarray | list[str],
    colours: np.ndarray | None = None,
    lost: np.ndarray | None = None,
    doubtful: np.ndarray | None = None,
) -> np.ndarray:
    """Draw labelled rectangles at any angle on a copy of the frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        corners: x, y in pixels [P, 4, 2], see ``geometry.corners_from_poses``; a rectangle that is
            not finite is skipped.
        names: the labels [P].
        colours: uint8 RGB [P, 3]; ``object_colours(P)`` by default.
        lost: bool [P]; a lost part is drawn as four corner dots and its label says "lost".
        doubtful: bool [P]; a probably lost part is drawn as four corner dots, and its label has a
            question mark.
    """
    frame = frame.copy()
    corners = np.asarray(corners, np.float64).reshape(-1, 4, 2)
    colours = object_colours(len(corners)) if colours is None else np.asarray(colours)
    nobody = np.zeros(len(corners), bool)
    lost = nobody if lost is None else np.asarray(lost, bool)
    doubtful = nobody if doubtful is None else np.asarray(doubtful, bool) & ~lost
    thickness = line_thickness(frame)
    rim = 2 if min(frame.shape[:2]) >= 240 else 1
    size = np.array(frame.shape[1::-1])
    labels = []
    for index, quad in enumerate(corners):
        if not np.isfinite(quad).all():
            continue
        # OpenCV counts from a pixel's centre, here in 16ths; clip to avoid overflow far outside.
        quad = np.clip(quad, -size, 2 * size)
        points = ((quad - 0.5) * 16).round().astype(np.int32)
        colour = _as_colour(colours[index])
        for line, width in ((DARK, thickness + rim), (colour, thickness)):
            if lost[index] or doubtful[index]:
                for point in points // 16:
                    cv2.circle(frame, (int(point[0]), int(point[1])), width, line, cv2.FILLED)
            else:
                cv2.polylines(frame, [points], True, line, width, cv2.LINE_AA, 4)
        left, top = map(int, np.floor(quad.min(axis=0)))
        right, bottom = map(int, np.ceil(quad.max(axis=0)))
        mark = " lost" if lost[index] else " ?" if doubtful[index] else ""
        labels.append(Label(f"{names[index]}{mark}", left, top, right, bottom, colour))
    draw_labels(frame, labels)
    return frame


def draw_particles(
    frame: np.ndarray,
    centres: np.ndarray,
    colours: np.ndarray | None = None,
    max_per_object: int = 200,
) -> np.ndarray:
    """Draw one dot per particle and object on a copy of the frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        centres: x, y in pixels [P, N, 2]; non-finite ones are skipped.
        colours: uint8 RGB [P, 3]; ``object_colours(P)`` by default.
        max_per_object: maximum number of particles to draw, evenly spaced in the particle index,
            so that the picture does not depend on chance.
    """
    frame = frame.copy()
    centres = np.asarray(centres, np.float64)
    colours = object_colours(len(centres)) if colours is None else np.asarray(colours)
    radius = max(1, round(min(frame.shape[:2]) / 300))
    num_particles = centres.shape[1]
    chosen = np.unique(
        np.linspace(0, num_particles - 1, min(num_particles, max_per_object)).round().astype(int)
    )
    dot = _dot(radius)
    height, width = frame.shape[:2]
    pixels = frame.reshape(-1, 3)
    for points, colour in zip(centres[:, chosen], colours, strict=True):
        # Only points near the frame: integers would overflow far outside.
        near = (points > -radius) & (points < (width + radius, height + radius))
        columns, rows = np.floor(points[near.all(axis=-1)]).astype(int).T[..., None] + dot
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        pixels[(rows * width + columns)[inside]] = colour
    return frame


def draw_spreads(
    frame: np.ndarray, centres: np.ndarray, spreads: np.ndarray, colours: np.ndarray | None = None
) -> np.ndarray:
    """Draw the uncertainty of each position: a faint ellipse of two standard deviations.

    Args:
        frame: uint8 RGB [H, W, 3].
        centres: x, y in pixels [P, 2]; non-finite ones are skipped.
        spreads: standard deviations of x and of y in pixels [P, 2].
        colours: uint8 RGB [P, 3]; ``object_colours(P)`` by default.
    """
    shown, size = frame.copy(), np.array(frame.shape[1::-1])
    colours = object_colours(len(centres)) if colours is None else np.asarray(colours)
    for centre, spread, colour in zip(centres, spreads, colours, strict=True):
        if not np.isfinite([*centre, *spread]).all() or (np.abs(centre) > 4 * size).any():
            continue
        # OpenCV counts from a pixel's centre, here in 16ths.
        middle, axes = (centre - 0.5) * 16, np.minimum(2 * spread, 4 * size) * 16
        at, reach = (tuple(map(int, np.round(values))) for values in (middle, axes))
        for line, width in ((DARK, 2 * line_thickness(frame) + 1), (_as_colour(colour), 1)):
            cv2.ellipse(shown, at, reach, 0, 0, 360, line, width, cv2.LINE_AA, 4)
    return cv2.addWeighted(shown, _FAINT, frame, 1 - _FAINT, 0)


def draw_pixel_grid(frame: np.ndarray, step: int | None = None) -> np.ndarray:
    """Draw a labelled grid, for reading the coordinates of a box off the picture.

    A frame whose longer side is under 480 pixels is enlarged by a whole factor to make the
    labels legible.  Labels count original pixels, and a note in the picture says so.

    Args:
        frame: uint8 RGB [H, W, 3].
        step: line spacing in original pixels; by default about ten lines along the longer side.

    Returns:
        uint8 RGB [k H, k W, 3], enlarged by k.
    """
    height, width = frame.shape[:2]
    enlargement = 1 if max(width, height) >= 480 else -(-640 // max(width, height))
    if step is None:
        nice = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
        step = next((value for value in nice if max(width, height) / value <= 13), nice[-1])
    if step < 1:
        raise ValueError(f"the step of the grid is at least one pixel, not {step}")
    size = (width * enlargement, height * enlargement)
    picture = cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST)
    line = line_thickness(picture)
    for values, draws_rows in (
        (range(step, width, step), False),
        (range(step, height, step), True),
    ):
        along = picture if draws_rows else picture.swapaxes(0, 1)
        for at in (value * enlargement for value in values):
            # Dark beside light is visible on any background; the coordinate is their border.
            _blend(along[max(at - line, 0) : at], 0)
            _blend(along[at : at + line], 255)
    for value in range(0, width, step):
        _text(picture, f"{value}", value * enlargement + 2, 2)
    for value in range(step, height, step):
        _text(picture, f"{value}", 2, value * enlargement + 2)
    if enlargement > 1:
        note = f"labels: original pixels, shown {enlargement}x"
        text_width, text_height = _text_size(picture, note)
        _text(picture, note, size[0] - text_width - 6, size[1] - text_height - 6)
    return picture


def _blend(pixels: np.ndarray, grey: int) -> None:
    pixels[...] = (0.4 * pixels + 0.6 * grey).astype(np.uint8)


def line_thickness(frame: np.ndarray) -> int:
    """Line thickness in pixels that is visible on a frame of this size."""
    return max(1, round(min(frame.shape[:2]) / 300))


def _font_scale(frame: np.ndarray) -> float:
    return max(_SMALLEST_FONT, min(frame.shape[:2]) / 950)


def _stroke(scale: float) -> int:
    """Thickness of letters: thinner than lines, so that the loops of an 8 stay open."""
    return max(1, int(2 * scale))


def _text_size(frame: np.ndarray, text: str) -> tuple[int, int]:
    scale = _font_scale(frame)
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, _stroke(scale))
    return width, height


def _dot(radius: int) -> np.ndarray:
    """Offsets x, y [2, 1, K] of the pixels of a filled circle from its centre."""
    stamp = np.zeros((2 * radius + 1, 2 * radius + 1), np.uint8)
    cv2.circle(stamp, (radius, radius), radius, 1, cv2.FILLED)
    return np.argwhere(stamp)[:, ::-1].T[:, None] - radius


def _as_colour(colour: np.ndarray) -> tuple[int, int, int]:
    return (int(colour[0]), int(colour[1]), int(colour[2]))


def _corners(box: np.ndarray, frame: np.ndarray) -> tuple[int, int, int, int]:
    """First and last column and row that a box covers, clipped to OpenCV's range."""
    height, width = frame.shape[:2]
    x, y, w, h = box
    columns = np.clip([x, x + w], -width, 2 * width).round()
    rows = np.clip([y, y + h], -height, 2 * height).round()
    left, top = int(columns[0]), int(rows[0])
    return left, top, max(left, int(columns[1]) - 1), max(top, int(rows[1]) - 1)


def _dashed_rectangle(
    frame: np.ndarray,
    first: tuple[int, int],
    last: tuple[int, int],
    colour: tuple[int, int, int],
    thickness: int,
) -> None:
    dash = 4 * line_thickness(frame) + 2
    (left, top), (right, bottom) = first, last
    for x in range(left, right + 1, 2 * dash):
        for y in (top, bottom):
            cv2.line(frame, (x, y), (min(x + dash, right), y), colour, thickness)
    for y in range(top, bottom + 1, 2 * dash):
        for x in (left, right):
            cv2.line(frame, (x, y), (x, min(y + dash, bottom)), colour, thickness)


class Label(NamedTuple):
    """An object's name and bounding rectangle in pixels."""

    text: str
    left: int
    top: int
    right: int
    bottom: int
    colour: tuple[int, int, int]


def draw_labels(frame: np.ndarray, labels: Sequence[Label]) -> None:
    """Draw names as tags that are no wider than their objects and avoid overlapping each other.

    A tag is placed above, below or inside its object.  Names of objects too small for legible
    letters are listed in the upper left corner instead.
    """
    height, width = frame.shape[:2]
    taken: list[tuple[int, int, int, int]] = []
    listed: list[Label] = []
    for label in labels:
        full = _tag_size(frame, label.text, _font_scale(frame))[0]
        scale = _font_scale(frame) * min(1.0, (label.right - label.left) / full)
        if scale < _SMALLEST_FONT:
            listed.append(label)
            continue
        wide, high = _tag_size(frame, label.text, scale)
        x = min(max(label.left, 0), max(width - wide, 0))
        places = [
            (x, min(max(y, 0), max(height - high, 0)))
            for y in (label.top - high, label.bottom, label.top)
        ]
        free = [p for p in places if not any(_overlap((*p, wide, high), other) for other in taken)]
        place = (free or places)[0]
        taken.append((*place, wide, high))
        _tag(frame, label.text, *place, label.colour, scale)
    y = 0
    for label in listed[:_MOST_LISTED]:
        wide, high = _tag_size(frame, label.text, _SMALLEST_FONT)
        if wide > width or y + high > height:
            break
        _tag(frame, label.text, 0, y, label.colour, _SMALLEST_FONT)
        y += high


def _overlap(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    """Whether two rectangles x, y, width, height overlap."""
    return all(
        one[axis] < other[axis] + other[axis + 2] and other[axis] < one[axis] + one[axis + 2]
        for axis in (0, 1)
    )


def _padding(frame: np.ndarray) -> int:
    return 2 + line_thickness(frame) if min(frame.shape[:2]) >= 240 else 1


def _tag_size(frame: np.ndarray, text: str, scale: float) -> tuple[int, int]:
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, _stroke(scale))
    return width + 2 * _padding(frame), height + 2 * _padding(frame)


def _tag(
    frame: np.ndarray, text: str, x: int, y: int, colour: tuple[int, int, int], scale: float
) -> None:
    """Draw a filled tag whose upper left corner is (x, y)."""
    width, height = _tag_size(frame, text, scale)
    cv2.rectangle(frame, (x, y), (x + width - 1, y + height - 1), colour, cv2.FILLED)
    luminance = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2]
    ink = DARK if luminance > 110 else _LIGHT
    origin = (x + _padding(frame), y + height - _padding(frame))
    cv2.putText(frame, text, origin, _FONT, scale, ink, _stroke(scale), cv2.LINE_AA)


def label_at(
    frame: np.ndarray, text: str, left: int, top: int, colour: tuple[int, int, int]
) -> None:
    """Draw a filled tag above the corner (left, top), moved into the frame if necessary."""
    height, width = frame.shape[:2]
    scale = _font_scale(frame)
    wide, high = _tag_size(frame, text, scale)
    y = top - high if top >= high else max(top, 0)
    x = min(max(left, 0), max(width - wide, 0))
    _tag(frame, text, x, min(y, max(height - high, 0)), colour, scale)


def _text(frame: np.ndarray, text: str, left: int, top: int) -> None:
    """Draw white text on a dark plate whose upper left corner is (left, top)."""
    width, height = _text_size(frame, text)
    pad = 1 + line_thickness(frame)
    last = (left + width + 2 * pad - 1, top + height + 2 * pad - 1)
    cv2.rectangle(frame, (left, top), last, DARK, cv2.FILLED)
    origin = (left + pad, top + pad + height)
    scale = _font_scale(frame)
    cv2.putText(frame, text, origin, _FONT, scale, _LIGHT, _stroke(scale), cv2.LINE_AA)
