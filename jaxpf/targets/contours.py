"""Contours: targets that are told by their outlines, look-alikes among them (maccormick1999).

A contour is a partition whose substate is a point of a shape space, such as ``jaxpf.models.shapes``
has; all coordinates are in pixels.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.errors import InputError
from jaxpf.files.contours import Contours, ContourTrackWriter, read_contours
from jaxpf.models.model import Model
from jaxpf.models.splines import basis, even_places, fit_spline, points_on, resampled
from jaxpf.names import EXCLUSIONS, SHAPE_SPACES
from jaxpf.options import check_options, option
from jaxpf.targets.target import Looks, Marks, Start, Target

#: Noise of every coordinate per frame, pixels: the shift's, and that of the shape.
DEFAULT_SCALE = (3.0, 1.0)
#: Pieces of the polyline that a contour is reported as.
_PIECES = 64
#: Control points of the contours of scenes, closed and open.
_SCENE_POINTS = {True: 16, False: 8}
#: So many particles' contours are drawn, the likeliest.
_DRAWN = 20


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the model of contours; see the help of each."""

    shape_space: str | None = option(
        None,
        "Of contours, how they may differ from their start: translation, similarity (also turned "
        "and scaled; the default) or affine; other shapes are learned, see --learned.",
        kind=str,
        choices=SHAPE_SPACES,
        compiles=True,
    )
    shift_noise: float | None = option(
        None,
        f"Of contours, noise of the shift in x and y per frame, pixels; by default "
        f"{DEFAULT_SCALE[0]:g}, or learned.",
        kind=float,
        least=0,
    )
    bend_noise: float | None = option(
        None,
        f"Of contours, noise of every other coordinate of the shape per frame, in pixels by which "
        f"its points move; by default {DEFAULT_SCALE[1]:g}, or learned.",
        kind=float,
        least=0,
    )
    exclusion: str = option(
        "wires",
        "Of contours, how they exclude one another: wires (no edge serves two), opaque (the "
        "same, of two closed contours, the nearer of which hides the other), none (an edge may "
        "serve several: the product of independent likelihoods, which lets look-alikes coalesce).",
        choices=EXCLUSIONS,
        compiles=True,
    )
    wire_width: float | None = option(
        None,
        "Of open contours, width in pixels of a wire both of whose edges are seen; by default what "
        "the file says.",
        kind=float,
        above=0,
    )
    lines: int = option(
        32, "Of contours, measurement lines on each.", least=4, most=1000, compiles=True
    )
    line_length: int = option(
        41,
        "Of contours, length of a measurement line, an odd number of pixels: how far off an edge "
        "may lie, twice.",
        least=3,
        most=253,
        compiles=True,
    )
    edge_threshold: float = option(
        8.0, "Of contours, least step in brightness of an edge, grey levels per pixel.", least=0
    )
    edge_smoothing: float = option(
        1.0,
        "Of contours, blur of the frame before edges are found, pixels.",
        least=0,
        most=20,
        compiles=True,
    )
    sigma: float = option(
        7.0, "Of contours, how far an edge may lie from the contour, pixels.", above=0
    )
    independence: float = option(
        0.3,
        "Of contours, share of its evidence that each measurement line counts: less than 1, since "
        "neighbours see the same; 1 as published, where few particles keep any weight.",
        above=0,
        most=1,
    )
    clutter: float | None = option(
        None,
        "Of contours, mean number of edges on a measurement line where no target is; by default "
        "the law of that number is learned from the start frame.",
        kind=float,
        above=0,
    )
    flip: float = option(
        0.01,
        "Of opaque contours, probability per frame that they change places in depth while they do "
        "not overlap.",
        least=0,
        most=1,
    )

    def __post_init__(self) -> None:
        check_options(self)


@dataclasses.dataclass(frozen=True, eq=False)
class ContourStart(Start):
    """Where contours are, and what is known of their kind.

    Attributes:
        contours: their control points.
        learned: shape space and dynamics (``jaxpf.files.learned_contours.Learned``), or None.
    """

    contours: Contours
    learned: Any = None


class ContourTarget(Target):
    """Contours as a target.

    A shape is a polyline x, y, x, y, ... in pixels; a closed contour's last point is its first.
    """

    name = "contours"
    noun = "contour"
    options = Options
    defaults: Mapping[str, Any] = {"method": "ps", "particles": 500}
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "contours": {
            "type": Path,
            "help": 'JSON of start contours, control points of splines in pixels: {"closed": true, '
            '"contours": {"leaf": [[10, 20], [30, 18], [32, 40], [12, 38]]}}; for wires "closed": '
            'false and "width": their width.',
        },
        "learned": {
            "type": Path,
            "help": "Shape space and dynamics of contours, from `jaxpf contour learn`.",
        },
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Target``."""
        if not given["contours"]:
            raise InputError(
                "no start contour: give --contours FILE.json with control points "
                f"(`jaxpf frame {source.path}` saves a frame with a pixel grid to read them off)."
            )
        found = read_contours(given["contours"])
        learned = None
        if given["learned"]:
            from jaxpf.files.learned_contours import read_learned

            learned = read_learned(given["learned"])
        start = _start(found, learned)
        for name, line in zip(found.names, _lines(start.shapes), strict=True):
            seen = (line >= 0) & (line < (source.width, source.height))
            if not seen.all(axis=1).any():
                raise InputError(
                    f"contour '{name}' lies outside the frame of {source.width} x {source.height} "
                    "pixels: move it inside, or leave it out."
                )
        return start

    def fits_scene(self, scene: Any) -> bool:
        """Whether the truth has outlines."""
        return {"outlines", "closed"} <= set(scene.extras)

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Target``."""
        closed = bool(scene.extras["closed"])
        outlines = np.asarray(scene.extras["outlines"], float)
        lines = [_polyline(line, closed) for pair in outlines for line in pair]
        return np.reshape(lines, (*outlines.shape[:2], -1))

    def scene_start(self, scene: Any) -> Start:
        """See ``Target``: splines nearest to the outlines of the first frame."""
        closed = bool(scene.extras["closed"])
        outlines = scene.extras["outlines"][0]
        points = [fit_spline(line, _SCENE_POINTS[closed], closed=closed) for line in outlines]
        names = scene.extras.get("ids", range(1, len(outlines) + 1))
        width = None if closed else scene.parameters.get("wire_width")
        return _start(
            Contours(tuple(map(str, names)), np.array(points), closed=closed, width=width)
        )

    def model(self, options: Options, start: Start, looks: Looks) -> Model:
        """See ``Target``; clutter is learned from ``looks.typical``.

        Raises:
            InputError: options that do not go with what was learned; see ``contours_model``.
        """
        from jaxpf.models.likelihoods.contours import EdgeDetector
        from jaxpf.targets.contour_tracking import contours_model

        assert isinstance(start, ContourStart)
        learned = start.learned
        if learned is not None and options.shape_space is not None:
            raise InputError(
                f"the shape space {options.shape_space} was asked for and a learned one was given; "
                "leave one of them out."
            )
        noise = options.shift_noise, options.bend_noise
        dynamics = None if learned is None else learned.dynamics_of(start.num_partitions)
        if dynamics is not None and noise != (None, None):
            raise InputError(
                "noise was given, but the learned file has dynamics of its own; leave one of them "
                "out, or learn again with --order 0."
            )
        contours = start.contours
        if options.wire_width is not None:
            contours = dataclasses.replace(contours, width=options.wire_width)
        return contours_model(
            contours,
            looks.typical,
            space=(options.shape_space or "similarity") if learned is None else learned.space,
            exclusion=options.exclusion,
            dynamics=dynamics,
            scale=[
                default if value is None else value
                for value, default in zip(noise, DEFAULT_SCALE, strict=True)
            ],
            detector=EdgeDetector(
                threshold=options.edge_threshold,
                length=options.line_length,
                smoothing=options.edge_smoothing,
            ),
            clutter=options.clutter,
            sigma=options.sigma,
            independence=options.independence,
            num_lines=options.lines,
            flip=options.flip,
        )

    def noise(self, options: Options, start: Start) -> np.ndarray:
        """See ``Target``."""
        shift = DEFAULT_SCALE[0] if options.shift_noise is None else options.shift_noise
        return np.array([shift, shift, np.nan])

    def positions(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        return _lines(np.asarray(shapes)).mean(axis=-2)

    def shapes_of(self, tracker: Any, start: Start, estimate: Any) -> np.ndarray:
        """See ``Target``: as the tracker's shape space draws them."""
        space = tracker.likelihood.space
        kind: dict[str, Any] = {"closed": space.closed, "degree": space.degree}
        matrix = basis(even_places(_PIECES + 1, closed=False), space.num_points, **kind)
        lines = matrix @ np.asarray(space.control_points(np.asarray(estimate)), float)
        if space.closed:
            lines[..., -1, :] = lines[..., 0, :]
        return lines.reshape(*lines.shape[:-2], -1)

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``: there and back again, so that what joins the ends is no line of its own.

        Not convex; ``measures`` knows.
        """
        import jax.numpy as jnp

        lines = _lines(jnp.asarray(shapes))
        return jnp.concatenate([lines, jnp.flip(lines, axis=-2)], axis=-2)

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """See ``Target``."""
        return start, shapes * np.tile(factors, shapes.shape[-1] // 2)

    def measures(self, start: Start, shapes: Any, truth: Any) -> dict[str, Any]:
        """See ``Target``."""
        import jax.numpy as jnp

        from jaxpf.measures.polylines import measure_polylines

        return measure_polylines(_lines(jnp.asarray(shapes)), _lines(jnp.asarray(truth)))

    def track_writer(self, path: Any, start: Start) -> Any:
        """See ``Target``: CSV with the header ``frame,contour,kind,point,x,y``."""
        return _Writer(path, start)

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Target``."""
        from jaxpf.media.contours_overlay import draw_contours

        return draw_contours(
            frame, _lines(np.asarray(shapes)), start.ids, marks.colours, marks.lost
        )

    def draw_particles(
        self, frame: Any, start: Start, tracker: Any, state: Any, colours: Any
    ) -> np.ndarray:
        """See ``Target``: the likeliest particles' contours, what is hidden dark and dashed."""
        from jaxpf.media.contours_overlay import draw_contour_particles

        log_weights = np.asarray(state.log_weights)
        best = np.argsort(log_weights)[::-1][:_DRAWN]
        lines = _lines(self.shapes_of(tracker, start, np.asarray(state.substates)[best]))
        hidden = None
        if getattr(state, "label", None) is not None and lines.shape[1] == 2:
            hidden = _hidden(lines, np.asarray(state.label)[best])
        return draw_contour_particles(frame, lines, np.exp(log_weights[best]), hidden, colours)


CONTOURS = ContourTarget()


class _Writer:
    """Contours of one run, frame by frame."""

    def __init__(self, path: Any, start: Start):
        self._names, self._writer = start.ids, ContourTrackWriter(path)
        contours = getattr(start, "contours", None)
        self._inverse = np.zeros((0, _PIECES + 1))  # without splines there is nothing to control
        if contours is not None:
            places = even_places(_PIECES + 1, closed=False)
            kind: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
            # A spline's points tell its control points: there are more of them.
            self._inverse = np.linalg.pinv(basis(places, contours.points.shape[1], **kind))

    def __enter__(self) -> "_Writer":
        self._writer.__enter__()
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._writer.__exit__(*exception)

    def append(self, frame: int, shapes: Any, lost: Any) -> None:
        lines = _lines(np.asarray(shapes, float))
        self._writer.append(frame, self._names, self._inverse @ lines, lines)


def _start(contours: Contours, learned: Any = None) -> ContourStart:
    kind: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
    lines = points_on(contours.points, _PIECES + (not contours.closed), **kind)
    if contours.closed:
        lines = np.concatenate([lines, lines[:, :1]], axis=1)
    count = len(lines)
    sizes = lines.max(axis=1) - lines.min(axis=1)
    return ContourStart(
        ids=np.asarray(contours.names),
        shapes=lines.reshape(count, -1),
        sizes=sizes,
        parents=(-1,) * count,
        contours=contours,
        learned=learned,
        remarks=contours.remarks,
    )


def _lines(shapes: Any) -> Any:
    """Shapes ``[..., P, 2 V]`` as polylines ``[..., P, V, 2]``."""
    return shapes.reshape(*shapes.shape[:-1], -1, 2)


def _polyline(outline: np.ndarray, closed: bool) -> np.ndarray:
    """A shape ``[2 V]`` from an outline ``[S, 2]``; NaN where it is not finite."""
    if not np.isfinite(outline).all():
        return np.full(2 * (_PIECES + 1), np.nan)
    even = resampled(outline, _PIECES + (not closed), closed=closed)
    return np.concatenate([even, even[:1]] if closed else [even]).ravel()


def _hidden(lines: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Which points of ``[n, 2, V, 2]`` lie inside the contour that a label says is in front."""
    import cv2

    found = np.zeros(lines.shape[:3], bool)
    for number, (pair, front) in enumerate(zip(lines, labels, strict=True)):
        if np.isfinite(pair).all():
            outline = pair[front].astype(np.float32)[:, None]
            found[number, 1 - front] = [
                cv2.pointPolygonTest(outline, (float(x), float(y)), False) > 0
                for x, y in pair[1 - front]
            ]
    return found
