"""Builds trackers of points on deforming bodies."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.numbers import check_array
from jaxpf.points.target import POINTS
from jaxpf.targets import building

if TYPE_CHECKING:
    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.ordering import Ordering


def tracker(
    frame: ArrayLike | None,
    points: ArrayLike,
    *,
    like: str | None = None,
    method: str | None = None,
    num_particles: int | None = None,
    likelihood: "LikelihoodLike | str | None" = None,
    ordering: "Ordering | None" = None,
    **options: Any,
) -> Any:
    """Build the point tracker of ``jaxpf track``.

    Example::

        tracker = jaxpf.points.tracker(frames[0], [[120, 80], [160, 95]])
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.points.to_points(tracker, summary.estimate)  # [T, P, 2]: x, y

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the points; tracking continues with the next
            frame.  It may be None with a user-defined likelihood.
        points: x and y in pixels, ``[P, 2]``.
        like: ``"eskil2014"`` for that paper's system as printed, or ``"pffl"`` for the one that it
            compares with; other arguments override it.
        method: ``"sps"`` (default), ``"ps"``, ``"pffl"``, ``"eskil"``, ...
        num_particles: number of particles; by default 1000, or 10 for eskil and 50 for pffl.
        likelihood: a user-defined likelihood of substates (u, v).
        ordering: from ``jaxpf.ordering``, instead of a method.
        options: named and explained as the flags of ``jaxpf track``: ``appearance``,
            ``noise_points``, ``momentum``, ``sigma``, ``window_size``, ``slip`` (8 pixels, as on
            joints of filmed animals; give 0 for drawn scenes), ...

    Returns:
        The tracker, for ``jaxpf.run``, ``jaxpf.stream`` and the others.

    Raises:
        InputError: an unknown option or a value out of range, a point outside the frame, two points
            at the same position, or a single point with eskil's drift; the message says which.
    """
    start = POINTS.start(points)
    given = {"like": like, "method": method, "num_particles": num_particles, **options}
    own = {"likelihood": likelihood, "ordering": ordering}
    return building.make(POINTS, frame, start, given, **own)


def to_points(tracker: "TrackerLike", estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to points x, y in pixels, ``[..., P, 2]``."""
    check_array("estimate", estimate, "x, y, [..., P, >= 2]")
    return np.asarray(estimate)[..., :2]
