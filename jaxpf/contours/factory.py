"""Contours: targets known by their outlines."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contours.data import Contours, Learned
from jaxpf.contours.target import CONTOURS, contour_start, polylines, shapes_of
from jaxpf.contract.errors import InputError
from jaxpf.targets import building


def tracker(
    frame: Any,
    contours: Contours,
    *,
    method: str | None = None,
    particles: int | None = None,
    likelihood: Any = None,
    ordering: Any = None,
    learned: Learned | None = None,
    **options: Any,
) -> Any:
    """The tracker of contours that ``jaxpf track`` makes.

    Args:
        frame: uint8 RGB ``[H, W, 3]``, from which clutter is learned; tracking goes on with the
            next one.  It may be None where the likelihood is one of your own.
        contours: where they are.
        method: ``"ps"`` (default) or ``"sir"``.
        particles: their number; default 500.
        likelihood: one of your own, of points of the shape space.
        ordering: from ``jaxpf.ordering``, instead of a method.
        learned: shape space and dynamics.
        options: named as the flags of ``jaxpf track``, which tells what they mean:
            ``shape_space``, ``exclusion``, ``clutter``, ``look_ahead``, ...

    Raises:
        InputError: an option that there is not, or a value out of range; the sentence says which.
    """
    if not isinstance(contours, Contours):
        raise InputError(
            f"contours is {type(contours).__name__}: give jaxpf.contours.Contours, such as "
            "Contours(names=(1, 2), points=points) with control points [P, K, 2]."
        )
    given = {"method": method, "particles": particles, **options}
    start = contour_start(contours, learned)
    return building.make(CONTOURS, frame, start, given, likelihood=likelihood, ordering=ordering)


def shapes(tracker: Any, estimate: ArrayLike) -> np.ndarray:
    """Polylines ``[..., P, V, 2]``, pixels, of estimates ``[..., P, D]``.

    A closed contour's last point is its first.

    Args:
        tracker: from ``tracker``.
        estimate: such as ``summary.estimate``.
    """
    return polylines(shapes_of(tracker, estimate))
