"""The point target: landmarks on one deforming body, recognised by the pixels around them.

A point is a partition with substate (u, v), pixels.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import Argument, InputError, check_names
from jaxpf.contract.model import Model
from jaxpf.contract.names import NORMS
from jaxpf.contract.numbers import numbers_in
from jaxpf.contract.options import check_options, option
from jaxpf.contract.ranges import RANGES
from jaxpf.points.files import grid_points, parse_points, read_points
from jaxpf.targets.appearance import PRETRAINED, WINDOWS, network_option, slip_option
from jaxpf.targets.later import check_inside, starts_by_frame
from jaxpf.targets.target import Looks, Marks, Start, Target

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.media.frame_source import FrameSource
    from jaxpf.points.files import Points
    from scenes import Scene

#: Side in pixels of the square that represents a point where an area is needed.
_SIDE = 21.0
#: Default spacing of a grid of points, pixels.
_MASK_STEP = 20.0
#: Slip on film, pixels ("Points" in docs/development/defaults.md).
_SLIP = 8.0
_OF_WINDOWS = ("appearance", WINDOWS)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the point model; see the help of each."""

    appearance: str = option(
        WINDOWS,
        "Appearance model: windows of pixels, or pretrained, the features of a small network (pip "
        "install 'jaxpf[pretrained]'): slower, often smaller errors, less reliable confidence.",
        choices=(WINDOWS, PRETRAINED),
        common=True,
        compiles=True,
    )
    network: str | None = network_option()
    sharpness: float = option(
        40.0,
        "Trust in the network's features: larger gives narrower intervals (pretrained appearance "
        "only).",
        **RANGES["sharpness"],
        path="likelihood.sharpness",
        implies=("appearance", PRETRAINED),
    )
    sigma: float = option(
        0.03,
        "Tolerated difference between windows; larger trusts the match less (windows only).",
        **RANGES["sigma"],
        path="likelihood.sigma",
        common=True,
        tuned=("",),
        implies=_OF_WINDOWS,
    )
    noise_points: float = option(
        2.0,
        "Noise per frame in pixels; larger for fast motion or large frames.",
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
        "Window size in pixels, an odd number (windows only).",
        least=1,
        most=999,
        common=True,
        implies=_OF_WINDOWS,
    )
    slip: float | None = slip_option()
    norm: str = option(
        "mean",
        "Whether a window's differences are averaged or summed (windows only).",
        choices=NORMS,
        implies=_OF_WINDOWS,
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.window_size % 2 == 0:
            raise InputError(
                Argument("window_size", self.window_size),
                f" must be an odd number of pixels, such as {self.window_size + 1}.",
            )


class _PointTarget(Target):
    """Points as a target; shapes are x, y in pixels."""

    name = "points"
    place = "point"
    options = Options
    coordinates = ("x", "y")
    defaults: Mapping[str, Any] = {"method": "sps", "num_particles": 1000}
    example = "--point 120,80,nose --point 161,95,shoulder"
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "point": {"multiple": True, "metavar": "X,Y[,NAME]", "help": "A start point; repeat it."},
        "points": {
            "type": Path,
            "help": "CSV of start points: lines x,y or x,y,name.  With the header frame,id,x,y a "
            "point in a later frame starts there, or is corrected.",
        },
        "mask": {
            "type": Path,
            "help": "A picture of the start frame's size; a grid of points starts where it is not "
            "black.",
        },
        "mask_step": {"type": float, "help": "Pixels between points of that grid.  [default: 20]"},
    }

    def start(self, given: Any, names: Sequence[object] | None = None) -> Start:
        """X and y ``[P, 2]``, pixels; default names are numbers from 0."""
        places = numbers_in("points", given, "x, y in pixels of every point, [>= 1, 2]")
        names = range(len(places)) if names is None else names
        check_names(names, len(places))
        ids = np.asarray(names, str)
        return Start(ids, places, np.full_like(places, _SIDE), (-1,) * len(places))

    def resolved(
        self, options: Options, settings: Mapping[str, Any], num_objects: int | None = None
    ) -> Options:
        if options.slip is not None:
            return options
        return dataclasses.replace(options, slip=settings.get("slip", _SLIP))

    def likelihood(self, options: Any, start: Start, looks: Looks) -> "LikelihoodLike":
        """The patches if they have the window's size, else windows or maps of the frame."""
        if options.appearance == PRETRAINED:
            from jaxpf.likelihoods.pretrained import efficientnet_lite0, pretrained_points

            return pretrained_points(
                looks.start_frame,
                start.shapes,
                network=efficientnet_lite0(options.network),
                sharpness=options.sharpness,
                slip=options.slip,
            )
        from jaxpf.likelihoods.patch import windows, windows_from_pictures

        side = (options.window_size, options.window_size)
        settings: dict[str, Any] = {
            "sigma": options.sigma,
            "norm": options.norm,
            "slip": options.slip,
        }
        if looks.patches is not None and all(patch.shape[:2] == side for patch in looks.patches):
            return windows_from_pictures(looks.patches, **settings)
        return windows(looks.start_frame, start.shapes, window=side, **settings)

    def model(self, options: Options, start: Start, likelihood: "LikelihoodLike") -> Model:
        """Substates are (u, v)."""
        from jaxpf.dynamics.gaussian import AR2

        _check_apart(start)
        return Model(
            dynamics=AR2(np.float32(options.noise_points), np.float32(options.momentum)),
            likelihood=likelihood,
            initial=start.shapes.astype(np.float32),
            parents=start.parents,
        )

    def shapes(self, start: Start, estimate: "ArrayLike", tracker: "TrackerLike") -> np.ndarray:
        return np.asarray(estimate)[..., :2]

    def outlines(self, start: Start, shapes: "ArrayLike") -> "jax.Array | np.ndarray":
        """Squares around the points, where polygons are needed."""
        import jax.numpy as jnp

        half = jnp.asarray(start.sizes, jnp.asarray(shapes).dtype)[:, None] / 2
        corners = jnp.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], half.dtype)
        return jnp.asarray(shapes)[..., None, :] + corners * half

    def read_start(self, given: Mapping[str, Any], number: int, source: "FrameSource") -> Start:
        said = [name for name in ("point", "points", "mask") if given[name]]
        if len(said) > 1:
            raise InputError(f"--{said[0]} and --{said[1]} were both given; use one of them.")
        if not said:
            raise InputError(
                "no start point: give --point x,y for every point, --points FILE.csv or --mask "
                f"PICTURE.  Draw the points with `jaxpf mark {source.path} --target points`."
            )
        if given["mask_step"] is not None and not given["mask"]:
            raise InputError(
                "--mask-step works only with --mask; add --mask PICTURE, or leave it out."
            )
        if given["mask"]:
            step = _MASK_STEP if given["mask_step"] is None else given["mask_step"]
            points = _on_mask(given["mask"], step, source)
        else:
            points = (
                read_points(given["points"]).at(number)
                if given["points"]
                else parse_points(given["point"])
            )
        check_inside("point", points.names, points.places, source)
        return self.start(points.places, points.names)

    def later_starts(
        self, given: Mapping[str, Any], number: int, source: "FrameSource"
    ) -> tuple[dict[int, Start], str | None]:
        """Points of later frames in the file of --points."""
        points = read_points(given["points"]) if given["points"] else None
        if points is None or points.frames is None:
            return {}, None

        def start_at(frame: int) -> Start:
            there = points.at(frame)
            check_inside("point", there.names, there.places, source)
            return self.start(there.places, there.names)

        return starts_by_frame(points.frames, np.array(points.names), number, start_at)

    def fits_scene(self, scene: "Scene") -> bool:
        """Whether the ground truth has points."""
        return "points" in scene.extras

    def scene_shapes(self, scene: "Scene") -> np.ndarray:
        """Hidden points count as absent."""
        points, visible = scene.extras["points"], scene.extras["visible"]
        return np.where(visible[..., None], points, np.nan)

    def scene_start(self, scene: "Scene") -> Start:
        """Raise InputError: a point is hidden in the first frame."""
        names, shown = scene.extras["point_names"], scene.extras["visible"][0]
        for name, visible in zip(names, shown, strict=True):
            if not visible:
                raise InputError(
                    f"point '{name}' of scene '{scene.name}' is hidden in the first frame, so that "
                    "nothing is known of its looks; leave it out or begin with another frame."
                )
        return self.start(scene.extras["points"][0], names)

    def draw(self, frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
        """Lost points are hollow, and doubtful ones have a question mark."""
        from jaxpf.points.drawing import draw_points

        doubtful = np.zeros(len(start.ids), bool) if marks.doubtful is None else marks.doubtful
        return draw_points(
            frame,
            shapes,
            trails=marks.past,
            hidden=marks.lost,
            colours=marks.colours,
            names=[
                f"{name} ?" if is_doubtful else f"{name}"
                for name, is_doubtful in zip(start.ids, doubtful, strict=True)
            ],
        )


POINTS = _PointTarget()


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


def _on_mask(path: Path, step: float, source: "FrameSource") -> "Points":
    """Return points on a grid within a mask of the frame's size."""
    from jaxpf.media.images import read_mask

    if not path.is_file():
        raise InputError(f"there is no mask at '{path}'; give a picture that is 0 off the body.")
    mask = read_mask(path) > 0
    if not mask.any():
        raise InputError(f"the mask '{path}' is 0 everywhere; mark the body in it.")
    if mask.shape != (source.height, source.width):
        raise InputError(
            f"the mask '{path}' has {mask.shape[1]} x {mask.shape[0]} pixels and the frame "
            f"{source.width} x {source.height}; give a mask of the frame's size."
        )
    return grid_points(mask, step)
