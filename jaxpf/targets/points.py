"""Trackers of points: landmarks on one deforming body, by any of the filters.

A point is a partition with substate (u, v), pixels.  Its outline, for drawings and measures, is the
point itself.
"""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.filters.factored.eskil import Eskil
from jaxpf.filters.factored.pffl import PFFL
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.dynamics import RandomWalk
from jaxpf.models.likelihoods.windows import windows

METHODS = ("eskil", "pffl", "sir", "ps", "sps")

#: Particles of the factored filters are per point; as published.
PARTICLES = {"eskil": 10, "pffl": 50, "sir": 300, "ps": 300, "sps": 300}


@dataclasses.dataclass(frozen=True)
class PointOptions:
    """How points are tracked; the paper's symbols are eskil2014's.

    Attributes:
        method: one of ``METHODS``.
        num_particles: per point for eskil and pffl, in all for the others; None takes
            ``PARTICLES``.
        scale: sigma_t, the standard deviation of the motion per frame, pixels.
        sigma: sigma_o of the window likelihood.
        window: side of the square window, an odd number of pixels.
        norm: ``"mean"`` or the literal ``"sum"``, see ``jaxpf.likelihoods.windows``.
        upsampling: how many times a particle is moved (eskil, pffl).
        drift: of eskil, see ``jaxpf.Eskil``.
        shape: of eskil.
        shape_scale: sigma_p, of eskil.
        memory: tau, of eskil, frames.
        proper: of eskil.
        form: of pffl, see ``jaxpf.PFFL``.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
    """

    method: str = "eskil"
    num_particles: int | None = None
    scale: float = 5.0
    sigma: float = 0.1
    window: int = 21
    norm: str = "mean"
    upsampling: int | None = None
    drift: str = "clip"
    shape: str = "relative"
    shape_scale: float = 0.1
    memory: int = 10
    proper: bool = False
    form: str = "auxiliary"
    resampling: str = "systematic"


def point_tracker(
    frame: np.ndarray, points: ArrayLike, options: PointOptions | None = None, **changes: Any
) -> Eskil | PFFL | Partitioned:
    """A tracker of points that start somewhere in a frame.

    Args:
        frame: uint8 RGB [H, W, 3], in which the points are; tracking goes on with the next one.
        points: [P, 2], x and y in pixels.
        options: default ``PointOptions()``.
        changes: options by name, in place of those.

    Raises:
        InputError: an unknown option or a value out of range, a point outside the frame, two
            points at one place or fewer than two for a drift; the sentence says which.
    """
    known = {field.name for field in dataclasses.fields(PointOptions)}
    for name in changes:
        if name not in known:
            raise InputError(f"there is no option {name!r}; choose among {', '.join(known)}.")
    chosen = dataclasses.replace(options or PointOptions(), **changes)
    if chosen.method not in METHODS:
        raise InputError(
            f"method {chosen.method!r} is unknown for points; choose one of {', '.join(METHODS)}."
        )
    if not (np.isfinite(chosen.scale) and chosen.scale >= 0):
        raise InputError(f"scale {chosen.scale} must be finite and not negative, in pixels.")
    points = np.asarray(points, np.float32)
    likelihood = windows(
        frame,
        points,
        sigma=chosen.sigma,
        window=(chosen.window, chosen.window),
        norm=chosen.norm,
    )
    _check_apart(points)
    walk = RandomWalk(np.float32(chosen.scale))
    number = PARTICLES[chosen.method] if chosen.num_particles is None else chosen.num_particles
    shared: dict[str, Any] = {"num_particles": number, "resampling": chosen.resampling}
    if chosen.method == "eskil":
        return Eskil(
            walk,
            likelihood,
            points,
            shape_scale=chosen.shape_scale,
            upsampling=3 if chosen.upsampling is None else chosen.upsampling,
            memory=chosen.memory,
            drift=chosen.drift,
            shape=chosen.shape,
            proper=chosen.proper,
            **shared,
        )
    if chosen.method == "pffl":
        upsampling = 1 if chosen.upsampling is None else chosen.upsampling
        return PFFL(walk, likelihood, points, upsampling=upsampling, form=chosen.form, **shared)
    num_points = len(points)
    ordering = {
        "sir": lambda: orderings.sir(num_points),
        "ps": lambda: orderings.ps(list(range(num_points))),
        "sps": lambda: orderings.sps(num_partitions=num_points),
    }[chosen.method]()
    return Partitioned(walk, likelihood, ordering, points, **shared)


def _check_apart(points: np.ndarray) -> None:
    for second in range(len(points)):
        for first in range(second):
            if np.array_equal(points[first], points[second]):
                x, y = points[first]
                raise InputError(
                    f"points {first} and {second} are both at ({x:g}, {y:g}): move or remove one."
                )
