"""Builds trackers of articulated objects: trees of rectangles at any angle."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.numbers import check_array
from jaxpf.parts.data import Parts
from jaxpf.parts.target import PARTS
from jaxpf.targets import building

if TYPE_CHECKING:
    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.ordering import Ordering


def tracker(
    frame: ArrayLike | None,
    parts: Parts,
    *,
    like: str | None = None,
    method: str | None = None,
    num_particles: int | None = None,
    likelihood: "LikelihoodLike | str | None" = None,
    ordering: "Ordering | None" = None,
    patches: Sequence[np.ndarray] | None = None,
    **options: Any,
) -> Any:
    """Build the part tracker of ``jaxpf track``.

    Example::

        parts = jaxpf.parts.Parts(
            names=("body", "arm"),
            parents=(-1, 0),
            poses=[[100, 80, 0], [110, 120, 0.3]],  # x, y, radians
            sizes=[[40, 60], [15, 50]],
        )
        tracker = jaxpf.parts.tracker(frames[0], parts)
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.parts.to_parts(tracker, summary.estimate)  # [T, P, 3]

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the parts; tracking continues with the next
            frame.  It may be None with a user-defined likelihood.
        parts: tree, poses and sizes of the parts of one or several objects.
        like: ``"gonzales2011"`` for that paper's system as printed; other arguments override it.
        method: ``"sps"`` (default), ``"ps"`` or ``"sir"``.
        num_particles: number of particles; default 300.
        likelihood: a user-defined likelihood of (u, v, scale, theta), or the name of a method to
            compute it.
        ordering: from ``jaxpf.ordering``, instead of a method.
        patches: P upright pictures, uint8 RGB ``[h, w, 3]``, from which appearance is learned
            instead of from the frame.
        options: named and explained as the flags of ``jaxpf track``; angles are in
            degrees: ``sharpness``, ``noise_pixels``, ``noise_joints``, ``dynamics``, ...

    Returns:
        The tracker, for ``jaxpf.run``, ``jaxpf.stream`` and the others.

    Raises:
        InputError: an unknown option or a value out of range; the message names it.
    """
    given = {"like": like, "method": method, "num_particles": num_particles, **options}
    own = {"likelihood": likelihood, "ordering": ordering, "patches": patches}
    return building.make(PARTS, frame, PARTS.start(parts), given, **own)


def to_parts(tracker: "TrackerLike", estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to poses x, y (pixels), theta (radians) ``[..., P, 3]``."""
    check_array("estimate", estimate, "x, y, theta, [..., P, >= 3]")
    return np.asarray(estimate)[..., :3]
