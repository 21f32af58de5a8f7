"""The point target: landmarks on one deforming body, recognised by the pixels around them.

A point is a partition with substate (u, v), pixels.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.contract.errors import Argument, InputError, check_names
from jaxpf.contract.model import Model
from jaxpf.contract.numbers import numbers_in
from jaxpf.contract.options import check_options, option
from jaxpf.targets.appearance import slip_option
from jaxpf.targets.target import Looks, Start, Target

#: Side in pixels of the square that represents a point where an area is needed.
_SIDE = 21.0
#: Slip on film, pixels ("Points" in docs/development/defaults.md).
_SLIP = 8.0


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the point model; see the help of each."""

    sigma: float = option(
        0.03,
        "Tolerated difference between windows; larger trusts the match less (points only).",
        above=0,
        path="likelihood.sigma",
        common=True,
        tuned=("",),
    )
    diffusion: float = option(
        2.0,
        "Noise per frame in pixels; larger for fast motion or large frames (points only).",
        least=0,
        path="dynamics.scale",
        common=True,
        tuned=("",),
    )
    momentum: float = option(
        0.9,
        "Share of the last displacement that is repeated; 0 with eskil's drift (points only).",
        least=0,
        most=1,
        path="dynamics.momentum",
    )
    window_size: int = option(
        13,
        "Window size in pixels, an odd number (points only).",
        least=1,
        most=999,
        common=True,
    )
    slip: float | None = slip_option()
    norm: str = option(
        "mean",
        "Whether a window's differences are averaged or summed (points only).",
        choices=("mean", "sum"),
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.window_size % 2 == 0:
            raise InputError(
                Argument("window_size", self.window_size),
                f" must be an odd number of pixels, such as {self.window_size + 1}.",
            )


class PointTarget(Target):
    """Points as a target; shapes are x, y in pixels."""

    name = "points"
    options = Options
    coordinates = ("x", "y")
    defaults: Mapping[str, Any] = {"method": "sps", "particles": 1000}

    def start(self, given: Any, names: Any = None) -> Start:
        """See ``Target``: x and y ``[P, 2]``, pixels; default names are numbers from 0."""
        places = numbers_in("points", given, "x, y in pixels of every point, [>= 1, 2]")
        names = range(len(places)) if names is None else names
        check_names(names, len(places))
        ids = np.asarray(names, str)
        return Start(ids, places, np.full_like(places, _SIDE), (-1,) * len(places))

    def resolved(
        self, options: Options, settings: Mapping[str, Any], num_objects: int | None = None
    ) -> Options:
        """See ``Target``."""
        if options.slip is not None:
            return options
        return dataclasses.replace(options, slip=settings.get("slip", _SLIP))

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        """See ``Target``."""
        return self.resolved(options, looks.settings)

    def likelihood(self, options: Options, start: Start, looks: Looks) -> Any:
        """See ``Target``: the patches if they have the window's size, else windows of the frame."""
        from jaxpf.likelihoods.windows import windows, windows_from_pictures

        side = (options.window_size, options.window_size)
        settings: dict[str, Any] = {
            "sigma": options.sigma,
            "norm": options.norm,
            "slip": options.slip,
        }
        if looks.patches is not None and all(patch.shape[:2] == side for patch in looks.patches):
            return windows_from_pictures(looks.patches, **settings)
        return windows(looks.start_frame, start.shapes, window=side, **settings)

    def model(self, options: Options, start: Start, likelihood: Any) -> Model:
        """See ``Target``; substates are (u, v)."""
        from jaxpf.dynamics.gaussian import AR2

        _check_apart(start)
        return Model(
            dynamics=AR2(np.float32(options.diffusion), np.float32(options.momentum)),
            likelihood=likelihood,
            initial=start.shapes.astype(np.float32),
            parents=start.parents,
        )

    def shapes(self, start: Start, estimate: Any, tracker: Any) -> np.ndarray:
        """See ``Target``."""
        return np.asarray(estimate)[..., :2]

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``: squares around the points, where polygons are needed."""
        import jax.numpy as jnp

        half = jnp.asarray(start.sizes, jnp.asarray(shapes).dtype)[:, None] / 2
        corners = jnp.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], half.dtype)
        return jnp.asarray(shapes)[..., None, :] + corners * half


POINTS = PointTarget()


def _check_apart(start: Start) -> None:
    places = start.shapes
    for second in range(len(places)):
        for first in range(second):
            if np.array_equal(places[first], places[second]):
                x, y = places[first]
                raise InputError(
                    f"points {start.ids[first]} and {start.ids[second]} are both at "
                    f"({x:g}, {y:g}): move or remove one."
                )
