"""Articulated objects: a tree of rectangles at any angle."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.parts.target import PARTS, Parts
from jaxpf.targets import building


def tracker(
    frame: Any,
    parts: Parts,
    *,
    method: str | None = None,
    particles: int | None = None,
    likelihood: Any = None,
    ordering: Any = None,
    patches: Any = None,
    **options: Any,
) -> Any:
    """The tracker of parts that ``jaxpf track`` makes.

    Args:
        frame: uint8 RGB ``[H, W, 3]``, in which the parts are; tracking goes on with the next one.
            It may be None where the likelihood is one of your own.
        parts: tree, poses and sizes of the parts of one or several objects.
        method: ``"sps"`` (default), ``"ps"`` or ``"sir"``.
        particles: their number; default 300.
        likelihood: one of your own, of (u, v, scale, theta); or the name of the way to compute it.
        ordering: from ``jaxpf.ordering``, instead of a method.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, upright, from which looks are learned instead
            of from the frame.
        options: named and explained as the flags of ``jaxpf track``; angles are in
            degrees: ``sharpness``, ``scale``, ``joint_scale``, ``dynamics``, ...

    Raises:
        InputError: an option that there is not, or a value out of range; the sentence says which.
    """
    given = {"method": method, "particles": particles, **options}
    own = {"likelihood": likelihood, "ordering": ordering, "patches": patches}
    return building.make(PARTS, frame, PARTS.start(parts), given, **own)


def shapes(tracker: Any, estimate: ArrayLike) -> np.ndarray:
    """Poses x, y in pixels and theta in radians, ``[..., P, 3]``, of estimates ``[..., P, D]``."""
    return np.asarray(estimate)[..., :3]
