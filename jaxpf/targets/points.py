"""Points: landmarks on one deforming body, known by the pixels around them.

A point is a partition with substate (u, v), pixels.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.models.model import Model
from jaxpf.options import check_options, chosen, option, options_of
from jaxpf.targets.target import Looks, Marks, Start, Target

#: Particles of filters whose particles are common to all points.
_PARTICLES = 300
#: Pixels between the points of a grid.
_MASK_STEP = 20.0


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the model of points; see the help of each."""

    diffusion: float = option(
        5.0,
        "Of points, noise per frame, pixels; larger for fast motion or large frames.",
        least=0,
        path="dynamics.scale",
    )
    sigma: float = option(
        0.1, "Of points, how much windows may differ.", above=0, path="likelihood.sigma"
    )
    window_size: int = option(
        21, "Of points, side of the window around each, an odd number of pixels.", least=1, most=999
    )
    norm: str = option(
        "mean", "Of points, whether a window's differences are averaged.", choices=("mean", "sum")
    )

    def __post_init__(self) -> None:
        check_options(self)


class Points(Target):
    """Points as a target; shapes are x, y in pixels."""

    name = "points"
    noun = "point"
    options = Options
    defaults: Mapping[str, Any] = {"method": "eskil"}
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "point": {"multiple": True, "metavar": "X,Y[,NAME]", "help": "A start point; repeat it."},
        "points": {"type": Path, "help": "CSV of start points: lines x,y or x,y,name."},
        "mask": {
            "type": Path,
            "help": "A picture of the start frame's size; a grid of points starts where it is not "
            "black.",
        },
        "mask_step": {"type": float, "help": "Pixels between points of that grid.  [default: 20]"},
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Target``."""
        from jaxpf.files.points import parse_points, read_points

        said = [name for name in ("point", "points", "mask") if given[name]]
        if len(said) > 1:
            raise InputError(f"--{said[0]} and --{said[1]} were both given; use one of them.")
        if not said:
            raise InputError(
                "no start point: give --point x,y for every point, --points FILE.csv or --mask "
                f"PICTURE (`jaxpf frame {source.path}` saves a frame with a pixel grid to read "
                "points off)."
            )
        if given["mask_step"] is not None and not given["mask"]:
            raise InputError("--mask-step is about the grid on a --mask, and none was given.")
        if given["mask"]:
            step = _MASK_STEP if given["mask_step"] is None else given["mask_step"]
            found = _on_mask(given["mask"], step, source)
        else:
            found = (
                read_points(given["points"]) if given["points"] else parse_points(given["point"])
            )
        for name, (x, y) in zip(found.names, found.places, strict=True):
            if not (0 <= x < source.width and 0 <= y < source.height):
                raise InputError(
                    f"point '{name}' is at ({x:g}, {y:g}), outside the frame of {source.width} x "
                    f"{source.height} pixels: move it inside, or leave it out."
                )
        return _start(found.names, found.places)

    def fits_scene(self, scene: Any) -> bool:
        """Whether the truth has points."""
        return "points" in scene.extras

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Target``; hidden points count as absent."""
        points, visible = scene.extras["points"], scene.extras["visible"]
        return np.where(visible[..., None], points, np.nan)

    def scene_start(self, scene: Any) -> Start:
        """See ``Target``.

        Raises:
            InputError: a point is hidden in the first frame.
        """
        names, shown = scene.extras["point_names"], scene.extras["visible"][0]
        for name, visible in zip(names, shown, strict=True):
            if not visible:
                raise InputError(
                    f"point '{name}' of scene '{scene.name}' is hidden in the first frame, so that "
                    "nothing is known of its looks; leave it out or begin with another frame."
                )
        return _start(names, scene.extras["points"][0])

    def model(self, options: Options, start: Start, looks: Looks) -> Model:
        """See ``Target``; points need the start frame itself."""
        from jaxpf.models.dynamics import RandomWalk
        from jaxpf.models.likelihoods.windows import windows, windows_from_pictures

        side = (options.window_size, options.window_size)
        settings: dict[str, Any] = {"sigma": options.sigma, "norm": options.norm}
        if looks.frame is None:
            likelihood = windows_from_pictures(looks.patches, **settings)
        else:
            likelihood = windows(looks.frame, start.shapes, window=side, **settings)
        _check_apart(start)
        return Model(
            dynamics=RandomWalk(np.float32(options.diffusion)),
            likelihood=likelihood,
            initial=start.shapes.astype(np.float32),
            parents=start.parents,
        )

    def tuned_by_default(self, options: Options) -> tuple[str, ...]:
        """See ``Target``."""
        return "likelihood.sigma", "dynamics.scale"

    def noise(self, options: Options, start: Start) -> np.ndarray:
        """See ``Target``."""
        return np.array([options.diffusion, options.diffusion, np.nan])

    def tuned(self, options: Options, values: Mapping[str, Any]) -> Options:
        """See ``Target``."""
        names = {"likelihood.sigma": "sigma", "dynamics.scale": "diffusion"}
        for path, value in values.items():
            if path not in names:
                raise InputError(f"a model of points has no {path}; apply the result to a tracker.")
            changed: dict[str, Any] = {names[path]: float(value)}
            options = dataclasses.replace(options, **changed)
        return options

    def positions(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        return shapes

    def shapes(self, start: Start, estimate: Any) -> np.ndarray:
        """See ``Target``."""
        return np.asarray(estimate)[..., :2]

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``: windows around the points, where something has to be a polygon."""
        import jax.numpy as jnp

        half = jnp.asarray(start.sizes, jnp.asarray(shapes).dtype)[:, None] / 2
        corners = jnp.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], half.dtype)
        return jnp.asarray(shapes)[..., None, :] + corners * half

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """See ``Target``."""
        return start, shapes * np.asarray(factors)

    def track_writer(self, path: Any, start: Start) -> Any:
        """See ``Target``."""
        return _Writer(path, start)

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Target``; lost points are hollow."""
        from jaxpf.media.points_overlay import draw_points

        return draw_points(
            frame,
            shapes,
            trails=marks.past,
            hidden=marks.lost,
            colours=marks.colours,
            names=start.ids.tolist(),
        )


POINTS = Points()


class _Writer:
    """Points of one run, frame by frame."""

    def __init__(self, path: Any, start: Start):
        from jaxpf.files.points import PointTrackWriter

        self._names, self._writer = start.ids.tolist(), PointTrackWriter(path)

    def __enter__(self) -> "_Writer":
        self._writer.__enter__()
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._writer.__exit__(*exception)

    def append(self, frame: int, shapes: Any, lost: Any) -> None:
        self._writer.append(frame, self._names, shapes, lost)


def _start(names: Any, places: Any) -> Start:
    places = np.asarray(places, np.float64)
    sizes = np.full_like(places, 21.0)
    return Start(np.asarray(names, str), places, sizes, (-1,) * len(places))


def _on_mask(path: Path, step: float, source: Any) -> Any:
    """Points of a grid on a mask of the frame's size."""
    from jaxpf.files.points import grid_points
    from jaxpf.media.images import read_image

    if not path.is_file():
        raise InputError(f"there is no mask at '{path}'; give a picture that is 0 off the body.")
    mask = read_image(path).any(axis=-1)
    if not mask.any():
        raise InputError(f"the mask '{path}' is 0 everywhere; mark the body in it.")
    if mask.shape != (source.height, source.width):
        raise InputError(
            f"the mask '{path}' has {mask.shape[1]} x {mask.shape[0]} pixels and the frame "
            f"{source.width} x {source.height}; give a mask of the frame's size."
        )
    return grid_points(mask, step)


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


def point_tracker(frame: np.ndarray, points: ArrayLike, **options: Any) -> Any:
    """A tracker of points that start somewhere in a frame.

    Args:
        frame: uint8 RGB [H, W, 3], in which the points are; tracking goes on with the next one.
        points: [P, 2], x and y in pixels.
        options: of ``Options`` and of the filter that has the method: ``method`` is one of eskil
            (default), pffl, sir, ps, sps.

    Raises:
        InputError: an unknown option or a value out of range, a point outside the frame, two
            points at one place or fewer than two for a drift; the sentence says which.
    """
    from jaxpf.filters.factored.options import FACTORED
    from jaxpf.filters.partitioned.options import PARTITIONED

    values = {"method": "eskil"} | options
    owners = {method: one for one in (PARTITIONED, FACTORED) for method in one.methods}
    if values["method"] not in owners:
        raise InputError(
            f"method {values['method']!r} is unknown for points; choose one of {', '.join(owners)}."
        )
    owner = owners[values["method"]]
    known = options_of(Options, owner.options)
    for name in values:
        if name not in known:
            raise InputError(
                f"there is no option {name!r} of {values['method']}; choose among "
                f"{', '.join(known)}."
            )
    places = np.asarray(points, np.float64)
    if places.ndim != 2 or places.shape[1] != 2:
        raise InputError(f"points has shape {list(places.shape)}: give a row (x, y) per point.")
    start = _start(range(len(places)), places)
    looks = Looks(frame, None, frame.shape[:2], values.get("particles") or _PARTICLES)
    model = POINTS.model(chosen(Options, values), start, looks)
    return owner.tracker(model, chosen(owner.options, values))
