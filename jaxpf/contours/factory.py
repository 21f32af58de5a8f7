"""Builds trackers of contours: targets recognised by their outlines."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contours.data import Contours, Learned
from jaxpf.contours.target import CONTOURS, contour_start, polylines, shapes_of
from jaxpf.contract.errors import check_type
from jaxpf.targets import building

if TYPE_CHECKING:
    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.ordering import Ordering


def tracker(
    frame: ArrayLike | None,
    contours: Contours,
    *,
    like: str | None = None,
    method: str | None = None,
    num_particles: int | None = None,
    likelihood: "LikelihoodLike | str | None" = None,
    ordering: "Ordering | None" = None,
    learned: Learned | None = None,
    **options: Any,
) -> Any:
    """Build the contour tracker of ``jaxpf track``.

    Example::

        leaf = [[100, 60], [140, 70], [160, 110], [130, 150], [90, 140], [70, 100]]
        contours = jaxpf.contours.Contours(names=("leaf",), points=[leaf])
        tracker = jaxpf.contours.tracker(frames[0], contours)
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.contours.to_contours(tracker, summary.estimate)  # [T, P, V, 2]: x, y

    Args:
        frame: uint8 RGB ``[H, W, 3]``, from which clutter is learned; tracking continues with the
            next frame.  It may be None with a user-defined likelihood.
        contours: the start contours.
        like: ``"maccormick1999"`` for that paper's system as printed; other arguments override it.
        method: ``"ps"`` (default) or ``"sir"``.
        num_particles: number of particles; default 500.
        likelihood: a user-defined likelihood of points of the shape space.
        ordering: from ``jaxpf.ordering``, instead of a method.
        learned: shape space and dynamics.
        options: named and explained as the flags of ``jaxpf track``: ``shape_space``,
            ``exclusion``, ``clutter``, ``joint_weighting``, ...

    Returns:
        The tracker, for ``jaxpf.run``, ``jaxpf.stream`` and the others.

    Raises:
        InputError: an unknown option or a value out of range; the message names it.
    """
    check_type("contours", contours, Contours)
    if learned is not None:
        check_type("learned", learned, Learned)
    given = {"like": like, "method": method, "num_particles": num_particles, **options}
    start = contour_start(contours, learned)
    return building.make(CONTOURS, frame, start, given, likelihood=likelihood, ordering=ordering)


def to_contours(tracker: "TrackerLike", estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to polylines ``[..., P, V, 2]``, pixels.

    A closed contour's last point equals its first.

    Args:
        tracker: from ``tracker``.
        estimate: such as ``summary.estimate``.
    """
    return polylines(shapes_of(tracker, estimate))
