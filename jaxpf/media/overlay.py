"""Draws tracked objects, their names and particles on frames.

Every function takes a uint8 RGB frame [H, W, 3] and returns a new one.  Coordinates are
continuous pixels: pixel (0, 0) is the square [0, 1) x [0, 1).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike

#: Opacity of faint lines.
_FAINT = 0.5
#: Fractional bits of OpenCV's coordinates.
_SHIFT = 4
#: Colour of rims, which keep lines visible on any background.
DARK = (20, 20, 20)
_LIGHT = (255, 255, 255)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
#: Smallest legible font scale.
_SMALLEST_FONT = 0.33
#: Maximum number of names that are listed in a corner.
_MOST_LISTED = 12
#: x, y, width, height in pixels.
_Rectangle = tuple[int, int, int, int]

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
#: Number of colours before they repeat.
NUM_COLOURS = 3 * len(_PALETTE)


def object_colours(num_objects: int) -> np.ndarray:
    """Return colours that people with any common kind of colour vision can distinguish.

    Seven are distinct; from the eighth object on they repeat, first lighter, then darker, and
    only the labels distinguish the objects.

    Returns:
        uint8 RGB [num_objects, 3].
    """
    palette = np.asarray(_PALETTE, np.float64)
    rounds = (palette, palette + 0.55 * (255 - palette), 0.55 * palette)
    colours = np.concatenate(rounds)[np.arange(num_objects) % NUM_COLOURS]
    return np.round(colours).astype(np.uint8)


def draw_boxes(
    frame: np.ndarray,
    boxes: ArrayLike,
    ids: Sequence[object] | np.ndarray | None = None,
    colours: np.ndarray | None = None,
    lost: ArrayLike | None = None,
    doubtful: ArrayLike | None = None,
) -> np.ndarray:
    """Draw labelled boxes on a copy of the frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        boxes: x, y, w, h in pixels [P, 4]; a box that is not finite is skipped.
        ids: the labels [P]; by default numbers, from 1.
        colours: see ``draw_outlines``.
        lost: see ``draw_outlines``.
        doubtful: see ``draw_outlines``.
    """
    x, y, w, h = np.reshape(np.asarray(boxes, float), (-1, 4)).T
    # Along the first and last row and column of pixels that a box covers.
    left, top = np.round(x) + 0.5, np.round(y) + 0.5
    right = np.maximum(np.round(x + w) - 0.5, left)
    bottom = np.maximum(np.round(y + h) - 0.5, top)
    corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
    names = range(1, len(x) + 1) if ids is None else ids
    lines = np.moveaxis(np.array(corners), -1, 0)
    return draw_outlines(frame, lines, names, colours, lost, doubtful, cv2.LINE_8)


def draw_outlines(
    frame: np.ndarray,
    lines: ArrayLike,
    names: Sequence[object] | np.ndarray,
    colours: np.ndarray | None = None,
    lost: ArrayLike | None = None,
    doubtful: ArrayLike | None = None,
    kind: int = cv2.LINE_AA,
) -> np.ndarray:
    """Draw labelled outlines, such as contours or turned rectangles, on a copy of the frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        lines: points in pixels [P, V, 2]; a closed outline ends with its first point.  An outline
            that is not finite is skipped.
        names: the labels [P].
        colours: uint8 RGB [P, 3]; ``object_colours(P)`` by default.
        lost: bool [P]; a lost object is dashed and faint, and its label says "lost".
        doubtful: bool [P]; a doubtful object is dashed, and its label has a question mark.
        kind: OpenCV's kind of line.
    """
    picture, outlines = np.ascontiguousarray(frame).copy(), np.asarray(lines, float)
    is_lost, is_doubtful = (
        np.zeros(len(outlines), bool) if marks is None else np.asarray(marks, bool)
        for marks in (lost, doubtful)
    )
    shades = shades_of(len(outlines), colours)
    # Clip, because OpenCV's integers overflow far outside.
    size, shown = np.array(frame.shape[1::-1]), np.isfinite(outlines).all(axis=(1, 2))
    outlines = np.clip(outlines, -size, 2 * size)
    faint = picture.copy()
    for index in np.flatnonzero(shown & is_lost):
        _draw_outline(faint, outlines[index], shades[index], True, kind)
    cv2.addWeighted(faint, _FAINT, picture, 1 - _FAINT, 0, dst=picture)
    for index in np.flatnonzero(shown & ~is_lost):
        _draw_outline(picture, outlines[index], shades[index], bool(is_doubtful[index]), kind)
    # Labels come last, so that no outline crosses one.
    labels = []
    for place, name in enumerate(names):
        if shown[place]:
            mark = " lost" if is_lost[place] else " ?" if is_doubtful[place] else ""
            low, high = outlines[place].min(axis=0), outlines[place].max(axis=0) + 0.5
            labels.append(Label.around(f"{name}{mark}", low, high, shades[place]))
    draw_labels(picture, labels)
    return picture


def shades_of(count: int, colours: ArrayLike | None) -> list[tuple[int, int, int]]:
    """Colours as OpenCV takes them; by default those of ``object_colours``."""
    rows = np.asarray(object_colours(count) if colours is None else colours)
    return [(int(red), int(green), int(blue)) for red, green, blue in rows]


def _draw_outline(
    picture: np.ndarray, line: np.ndarray, colour: tuple[int, int, int], dashed: bool, kind: int
) -> None:
    thickness, rim = line_thickness(picture), 2 if min(picture.shape[:2]) >= 240 else 1
    length = 4 * thickness + 2
    # Round ends shorten the gaps.
    pieces = _dashes(line, length, length + thickness + rim) if dashed else [line]
    # OpenCV counts from a pixel's centre.
    fixed = [np.round((piece - 0.5) * 2**_SHIFT).astype(np.int32) for piece in pieces]
    # A dark rim keeps every colour visible on every background.
    for shade, width in ((DARK, thickness + rim), (colour, thickness)):
        cv2.polylines(picture, fixed, False, shade, width, kind, _SHIFT)


def _dashes(line: np.ndarray, length: float, gap: float) -> Iterator[np.ndarray]:
    """Pieces of a line [V, 2], each ``length`` pixels long."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    for start in np.arange(0, max(along[-1], 1e-9), length + gap):
        end = min(start + length, along[-1])
        at = [start, *along[(along > start) & (along < end)], end]
        yield np.stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)], axis=1)


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
    frame, centres = frame.copy(), np.asarray(centres, float)
    radius = line_thickness(frame)
    num_particles = centres.shape[1]
    chosen = np.unique(
        np.linspace(0, num_particles - 1, min(num_particles, max_per_object)).round().astype(int)
    )
    dot = _dot(radius)
    height, width = frame.shape[:2]
    pixels = frame.reshape(-1, 3)
    for points, colour in zip(centres[:, chosen], shades_of(len(centres), colours), strict=True):
        # Only points near the frame: integers would overflow far outside.
        near = (points > -radius) & (points < (width + radius, height + radius))
        columns, rows = np.floor(points[near.all(axis=-1)]).astype(int).T[..., None] + dot
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        pixels[(rows * width + columns)[inside]] = colour
    return frame


def _dot(radius: int) -> np.ndarray:
    """Offsets x, y [2, 1, K] of the pixels of a filled circle from its centre."""
    stamp = np.zeros((2 * radius + 1, 2 * radius + 1), np.uint8)
    cv2.circle(stamp, (radius, radius), radius, 1, cv2.FILLED)
    return np.argwhere(stamp)[:, ::-1].T[:, None] - radius


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
    shades = shades_of(len(centres), colours)
    for centre, spread, colour in zip(centres, spreads, shades, strict=True):
        if not np.isfinite([*centre, *spread]).all() or (np.abs(centre) > 4 * size).any():
            continue
        middle, axes = (centre - 0.5) * 2**_SHIFT, np.minimum(2 * spread, 4 * size) * 2**_SHIFT
        at, reach = (tuple(map(int, np.round(values))) for values in (middle, axes))
        for line, width in ((DARK, 2 * line_thickness(frame) + 1), (colour, 1)):
            cv2.ellipse(shown, at, reach, 0, 0, 360, line, width, cv2.LINE_AA, _SHIFT)
    return cv2.addWeighted(shown, _FAINT, frame, 1 - _FAINT, 0)


class Label(NamedTuple):
    """An object's name and bounding rectangle in pixels."""

    text: str
    left: int
    top: int
    right: int
    bottom: int
    colour: tuple[int, int, int]

    @classmethod
    def around(
        cls, text: str, low: ArrayLike, high: ArrayLike, colour: tuple[int, int, int]
    ) -> "Label":
        """The label of an object from corner ``low`` to corner ``high``, each x, y."""
        (left, top), (right, bottom) = np.floor(low).astype(int), np.ceil(high).astype(int)
        return cls(text, int(left), int(top), int(right), int(bottom), colour)


def draw_labels(frame: np.ndarray, labels: Sequence[Label], beside: bool = False) -> None:
    """Draw names as tags: above, below or inside their objects, and no wider than these.

    Tags avoid overlapping each other.  Names of objects too small for legible letters are listed in
    the upper left corner instead.

    Args:
        frame: uint8 RGB [H, W, 3], on which to draw.
        labels: the names and where their objects are.
        beside: whether tags stand beside small marks, such as points.  Then none covers a mark or
            another tag, and names without a free place are listed.
    """
    legible = max(_SMALLEST_FONT, min(frame.shape[:2]) / (1600 if beside else 950))
    taken = [(x, y, right - x, bottom - y) for _, x, y, right, bottom, _ in labels if beside]
    listed: list[Label] = []
    for label in labels:
        text, left, top, right, bottom, colour = label
        scale, (wide, high) = legible, _tag_size(frame, text, legible)
        if beside:
            heights = (top - high, bottom, (top + bottom - high) // 2)
            corners = [(x, y) for x in (right, left - wide) for y in heights]
        else:
            scale = legible * min(1.0, (right - left) / wide)
            wide, high = _tag_size(frame, text, scale)
            corners = [(left, y) for y in (top - high, bottom, top)]
        places = [_moved_inside(frame, (*corner, wide, high)) for corner in corners]
        free = [place for place in places if not any(_meet(place, each) for each in taken)]
        if scale < _SMALLEST_FONT or (beside and not free):
            listed.append(label)
            continue
        place = (free or places)[0]
        taken.append(place)
        _tag(frame, text, *place[:2], colour, scale)
    y = 0
    for text, *_, colour in listed[:_MOST_LISTED]:
        wide, high = _tag_size(frame, text, _SMALLEST_FONT)
        if wide > frame.shape[1] or y + high > frame.shape[0]:
            break
        _tag(frame, text, 0, y, colour, _SMALLEST_FONT)
        y += high


def _moved_inside(frame: np.ndarray, place: _Rectangle) -> _Rectangle:
    x, y, wide, high = place
    height, width = frame.shape[:2]
    return min(max(x, 0), max(width - wide, 0)), min(max(y, 0), max(height - high, 0)), wide, high


def _meet(one: _Rectangle, other: _Rectangle) -> bool:
    """Whether two rectangles overlap."""
    return all(
        one[axis] < other[axis] + other[axis + 2] and other[axis] < one[axis] + one[axis + 2]
        for axis in (0, 1)
    )


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


def _tag_size(frame: np.ndarray, text: str, scale: float) -> tuple[int, int]:
    """Width and height of a tag in pixels."""
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, _stroke(scale))
    return width + 2 * _padding(frame), height + 2 * _padding(frame)


def line_thickness(frame: np.ndarray) -> int:
    """Line thickness in pixels that is visible on a frame of this size."""
    return max(1, round(min(frame.shape[:2]) / 300))


def _stroke(scale: float) -> int:
    """Thickness of letters: thinner than lines, so that the loops of an 8 stay open."""
    return max(1, int(2 * scale))


def _padding(frame: np.ndarray) -> int:
    return 2 + line_thickness(frame) if min(frame.shape[:2]) >= 240 else 1
