"""Data of articulated objects."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class Parts:
    """The parts of one or several articulated objects.

    Attributes:
        names: of the P parts.
        parents: index of each part's parent, -1 for the root of an object.
        poses: ``[P, 3]``: x, y of the centre in pixels, and the angle in radians, clockwise.
        sizes: ``[P, 2]``: width and height in pixels.
    """

    names: tuple[object, ...]
    parents: tuple[int, ...]
    poses: np.ndarray
    sizes: np.ndarray
