"""Writes names of objects on frames: readable, no wider than their objects, and apart."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_FONT = cv2.FONT_HERSHEY_SIMPLEX
#: Colour of rims, which keep lines visible on any background.
DARK = (20, 20, 20)
_LIGHT = (255, 255, 255)
#: Smallest legible font scale.
_SMALLEST_FONT = 0.33
#: Maximum number of names that are listed in a corner.
_MOST_LISTED = 12

#: x, y, width, height in pixels.
_Rectangle = tuple[int, int, int, int]


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
        cls, text: str, low: "ArrayLike", high: "ArrayLike", colour: tuple[int, int, int]
    ) -> "Label":
        """The label of an object from corner ``low`` to corner ``high``, each x, y."""
        (left, top), (right, bottom) = np.floor(low).astype(int), np.ceil(high).astype(int)
        return cls(text, int(left), int(top), int(right), int(bottom), colour)


def draw_labels(frame: np.ndarray, labels: Sequence[Label]) -> None:
    """Draw names as tags that are no wider than their objects and avoid overlapping each other.

    A tag is placed above, below or inside its object.  Names of objects too small for legible
    letters are listed in the upper left corner instead.
    """

    def places(label: Label) -> tuple[float, list[tuple[int, int]], bool]:
        full = tag_size(frame, label.text, font_scale(frame))[0]
        scale = font_scale(frame) * min(1.0, (label.right - label.left) / full)
        high = tag_size(frame, label.text, scale)[1]
        corners = [(label.left, y) for y in (label.top - high, label.bottom, label.top)]
        return scale, corners, True

    _draw(frame, labels, [], places)


def draw_labels_beside(frame: np.ndarray, labels: Sequence[Label]) -> None:
    """Draw names beside small marks, such as points; no tag covers a mark or another tag.

    Names without a free place beside their mark are listed in the upper left corner.
    """
    scale = max(_SMALLEST_FONT, min(frame.shape[:2]) / 1600)
    taken = [
        (each.left, each.top, each.right - each.left, each.bottom - each.top) for each in labels
    ]

    def places(label: Label) -> tuple[float, list[tuple[int, int]], bool]:
        wide, high = tag_size(frame, label.text, scale)
        corners = [
            (x, y)
            for x in (label.right, label.left - wide)
            for y in (label.top - high, label.bottom, (label.top + label.bottom - high) // 2)
        ]
        return scale, corners, False

    _draw(frame, labels, taken, places)


def _draw(
    frame: np.ndarray,
    labels: Sequence[Label],
    taken: list[_Rectangle],
    places_of: Callable[[Label], tuple[float, list[tuple[int, int]], bool]],
) -> None:
    """Draw each tag at its first corner that is free, and list those without a place.

    ``places_of`` gives a tag's font scale, its corners, and whether it may cover another tag.
    """
    listed: list[Label] = []
    for label in labels:
        scale, corners, may_cover = places_of(label)
        size = tag_size(frame, label.text, scale)
        places = [_moved_inside(frame, (*corner, *size)) for corner in corners]
        free = [place for place in places if not _meets(place, taken)]
        if scale < _SMALLEST_FONT or not (free or may_cover):
            listed.append(label)
            continue
        place = (free or places)[0]
        taken.append(place)
        tag(frame, label.text, *place[:2], label.colour, scale)
    _list(frame, listed)


def _list(frame: np.ndarray, labels: Sequence[Label]) -> None:
    """List names in the upper left corner."""
    y = 0
    for label in labels[:_MOST_LISTED]:
        wide, high = tag_size(frame, label.text, _SMALLEST_FONT)
        if wide > frame.shape[1] or y + high > frame.shape[0]:
            break
        tag(frame, label.text, 0, y, label.colour, _SMALLEST_FONT)
        y += high


def _moved_inside(frame: np.ndarray, place: _Rectangle) -> _Rectangle:
    x, y, wide, high = place
    height, width = frame.shape[:2]
    return min(max(x, 0), max(width - wide, 0)), min(max(y, 0), max(height - high, 0)), wide, high


def _meets(place: _Rectangle, others: Iterable[_Rectangle]) -> bool:
    """Whether a rectangle overlaps any other."""
    return any(
        all(
            place[axis] < other[axis] + other[axis + 2]
            and other[axis] < place[axis] + place[axis + 2]
            for axis in (0, 1)
        )
        for other in others
    )


def tag(
    frame: np.ndarray, text: str, x: int, y: int, colour: tuple[int, int, int], scale: float
) -> None:
    """Draw a filled tag whose upper left corner is (x, y)."""
    width, height = tag_size(frame, text, scale)
    cv2.rectangle(frame, (x, y), (x + width - 1, y + height - 1), colour, cv2.FILLED)
    luminance = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2]
    ink = DARK if luminance > 110 else _LIGHT
    origin = (x + _padding(frame), y + height - _padding(frame))
    cv2.putText(frame, text, origin, _FONT, scale, ink, _stroke(scale), cv2.LINE_AA)


def tag_size(frame: np.ndarray, text: str, scale: float) -> tuple[int, int]:
    """Width and height of a tag in pixels."""
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, _stroke(scale))
    return width + 2 * _padding(frame), height + 2 * _padding(frame)


def font_scale(frame: np.ndarray) -> float:
    """Font scale that is legible on a frame of this size."""
    return max(_SMALLEST_FONT, min(frame.shape[:2]) / 950)


def line_thickness(frame: np.ndarray) -> int:
    """Line thickness in pixels that is visible on a frame of this size."""
    return max(1, round(min(frame.shape[:2]) / 300))


def _stroke(scale: float) -> int:
    """Thickness of letters: thinner than lines, so that the loops of an 8 stay open."""
    return max(1, int(2 * scale))


def _padding(frame: np.ndarray) -> int:
    return 2 + line_thickness(frame) if min(frame.shape[:2]) >= 240 else 1
