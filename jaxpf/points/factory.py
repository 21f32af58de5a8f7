"""Points on deforming bodies."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.points.target import POINTS
from jaxpf.targets import building


def tracker(
    frame: Any,
    points: ArrayLike,
    *,
    method: str | None = None,
    particles: int | None = None,
    likelihood: Any = None,
    ordering: Any = None,
    **options: Any,
) -> Any:
    """The tracker of points that ``jaxpf track`` makes.

    Args:
        frame: uint8 RGB ``[H, W, 3]``, in which the points are; tracking goes on with the next one.
            It may be None where the likelihood is one of your own.
        points: x and y in pixels, ``[P, 2]``.
        method: ``"eskil"`` (default), ``"pffl"``, ``"sir"``, ``"ps"``, ...
        particles: their number; by default the method's.
        likelihood: one of your own, of substates (u, v).
        ordering: from ``jaxpf.ordering``, instead of a method.
        options: named as the flags of ``jaxpf track``, which tells what they mean: ``diffusion``,
            ``sigma``, ``window_size``, ``drift``, ...

    Raises:
        InputError: an unknown option or a value out of range, a point outside the frame, two
            points at one place or fewer than two for a drift; the sentence says which.
    """
    given = {"method": method, "particles": particles, **options}
    own = {"likelihood": likelihood, "ordering": ordering}
    return building.make(POINTS, frame, POINTS.start(points), given, **own)


def shapes(tracker: Any, estimate: ArrayLike) -> np.ndarray:
    """Points x, y in pixels, ``[..., P, 2]``, of estimates ``[..., P, D]``."""
    return np.asarray(estimate)[..., :2]
