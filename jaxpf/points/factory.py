"""Builds trackers of points: landmarks on one deforming body, known by the pixels around them.

A point is a partition with substate (u, v), pixels.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from jaxpf import filters
from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model
from jaxpf.contract.options import Option
from jaxpf.contract.types import LikelihoodLike, TrackerLike
from jaxpf.dynamics.gaussian import AR2
from jaxpf.likelihoods.patch import windows, windows_from_pictures
from jaxpf.likelihoods.pretrained import efficientnet_lite0, pretrained_points
from jaxpf.targets.building import Network, TrackerOptions, factory, looks_of
from jaxpf.targets.target import Looks, Start

#: Side in pixels of the square that represents a point where an area is needed.
_SIDE = 21.0
#: Slip on film, pixels ("Points" in docs/development/defaults.md).
_SLIP = 8.0


@factory("points")
def tracker(
    frame: ArrayLike | Looks | None,
    points: ArrayLike | Start,
    *,
    likelihood: LikelihoodLike | None = None,
    appearance: Annotated[
        Literal["windows", "pretrained"],
        Option(
            "Appearance model: windows of pixels, or pretrained, the features of a small network "
            "(pip install 'jaxpf[pretrained]'): slower, often smaller errors, less reliable "
            "confidence.",
            compiles=True,
        ),
    ] = "windows",
    network: Network = None,
    sharpness: Annotated[
        float,
        Option(
            "Trust in the network's features: larger gives narrower intervals (pretrained "
            "appearance only).",
            above=0,
            path="likelihood.sharpness",
            needs=("appearance", "pretrained"),
        ),
    ] = 40.0,
    sigma: Annotated[
        float,
        Option(
            "Tolerated difference between windows; larger trusts the match less (windows only).",
            above=0,
            path="likelihood.sigma",
            tuned=("",),
            needs=("appearance", "windows"),
        ),
    ] = 0.03,
    noise_points: Annotated[
        float,
        Option(
            "Noise per frame in pixels; larger for fast motion or large frames.",
            least=0,
            path="dynamics.scale",
            tuned=("",),
        ),
    ] = 2.0,
    momentum: Annotated[
        float,
        Option(
            "Share of the last displacement that is repeated; 0 with eskil's drift.",
            least=0,
            most=1,
            path="dynamics.momentum",
            rare=True,
        ),
    ] = 0.9,
    window_size: Annotated[
        int,
        Option(
            "Window size in pixels, an odd number (windows only).",
            least=1,
            most=999,
            needs=("appearance", "windows"),
        ),
    ] = 13,
    slip: Annotated[
        float | None,
        Option(
            "Widens the intervals: standard deviation in pixels of a point around its best match.  "
            "By default, as measured on film, 8; 0 in synthetic scenes.",
            least=0,
        ),
    ] = None,
    norm: Annotated[
        Literal["mean", "sum"],
        Option(
            "Whether a window's differences are averaged or summed (windows only).",
            needs=("appearance", "windows"),
            rare=True,
        ),
    ] = "mean",
    **options: Unpack[TrackerOptions],
) -> Any:
    """Build the point tracker of ``jaxpf track``.

    Example::

        tracker = jaxpf.points.tracker(frames[0], [[120, 80], [160, 95]])
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.points.to_points(tracker, summary.estimate)  # [T, P, 2]: x, y

    Options without an entry here are explained in the signature.

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the points; tracking continues with the next
            frame.  It may be None with a user-defined likelihood.
        points: x and y in pixels, ``[P, 2]``.
        likelihood: a user-defined likelihood of substates (u, v).
        options: ``like="eskil2014"`` for that paper's system as printed, or ``"pffl"`` for the one
            that it compares with, which other arguments override; ``method``, ``"sps"`` (default),
            ``"ps"``, ``"pffl"``, ``"eskil"``, ..., or an ``ordering`` of ``jaxpf.ordering``;
            ``num_particles``, by default 1000, or 10 for eskil and 50 for pffl; and those of the
            method's filter: ``resampling``, ``drift``, ...
    """
    assert isinstance(points, Start), "by the decorator"
    if likelihood is None:
        looks = looks_of(frame)
        about: dict[str, Any] = {"sigma": sigma, "norm": norm, "slip": slip}
        patches, size = looks.patches, (window_size, window_size)
        if appearance == "pretrained":
            about = {"sharpness": sharpness, "slip": slip, "network": efficientnet_lite0(network)}
            likelihood = pretrained_points(looks.frame, points.shapes, **about)
        elif patches is not None and all(patch.shape[:2] == size for patch in patches):
            likelihood = windows_from_pictures(patches, **about)
        else:
            likelihood = windows(looks.frame, points.shapes, window=size, **about)
    _check_apart(points)
    motion = AR2(np.float32(noise_points), np.float32(momentum))
    model = Model(motion, likelihood, points.shapes.astype(np.float32), points.parents)
    return filters.build(model, **options)


def start(given: Any, names: Sequence[object] | None = None) -> Start:
    """Where points ``[P, 2]``, x and y in pixels, start; default names are numbers from 0."""
    places = np.asarray(given, float)
    ids = np.asarray(range(len(places)) if names is None else names, str)
    return Start(ids, places, np.full_like(places, _SIDE), (-1,) * len(places))


def settle(
    values: Mapping[str, Any], settings: Mapping[str, Any], num_objects: int | None = None
) -> dict[str, Any]:
    """By default the slip of points on film."""
    if values["slip"] is None:
        return {**values, "slip": settings.get("slip", _SLIP)}
    return dict(values)


def to_points(tracker: TrackerLike, estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to points x, y in pixels, ``[..., P, 2]``."""
    return np.asarray(estimate)[..., :2]


def _check_apart(start: Start) -> None:
    seen: dict[tuple[float, ...], object] = {}
    for name, place in zip(start.ids, map(tuple, start.shapes.tolist()), strict=True):
        if place in seen:
            raise InputError(
                f"points {seen[place]} and {name} are both at ({place[0]:g}, {place[1]:g}): move "
                "or remove one."
            )
        seen[place] = name
