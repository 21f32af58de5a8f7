"""The contour target: objects, including look-alikes, recognised by outline (maccormick1999).

A contour is a partition whose substate is a point of a shape space, such as those of
``jaxpf.shapes.spaces``; all coordinates are in pixels.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contours.data import Contours, Learned
from jaxpf.contours.files import ContourTrackWriter, read_contours
from jaxpf.contours.options import FLIP, Options
from jaxpf.contract.errors import InputError, check_tracker
from jaxpf.contract.model import Model
from jaxpf.contract.numbers import check_array
from jaxpf.contract.optional import optional
from jaxpf.shapes.splines import basis, even_places, fit_spline, points_on, resample_polyline
from jaxpf.targets.target import Looks, Marks, Start, Target

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.media.frame_source import FrameSource
    from jaxpf.shapes.spaces import ShapeSpace
    from scenes import Scene

#: Number of segments of a reported polyline.
PIECES = 64
#: Default slip on film of open and of closed contours, as a share of their size; see
#: "Contours" in docs/development/defaults.md.
_SLIP = {False: 0.1, True: 0.05}
#: Number of control points of a scene's contours, closed and open.
_SCENE_POINTS = {True: 16, False: 8}
#: Number of particles to draw, those with the largest weights.
_DRAWN = 20


@dataclasses.dataclass(frozen=True, eq=False)
class ContourStart(Start):
    """Start contours, with an optional learned model.

    Attributes:
        contours: their control points.
        learned: shape space and dynamics (``jaxpf.contours.Learned``), or None.
    """

    contours: Contours
    learned: Learned | None = None


class _ContourTarget(Target):
    """Contours as a target.

    A shape is a polyline x, y, x, y, ... in pixels; a closed contour's last point equals its first.
    """

    name = "contours"
    options = Options
    defaults: Mapping[str, Any] = {"method": "ps", "num_particles": 500}
    unsuited = ("sps",)  # exclusion weighs contours together
    example = "--contours wires.json --sigma 3"
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "contours": {
            "type": Path,
            "help": "JSON of start contours, control points of splines in pixels.  Such as "
            '{"closed": true, "contours": {"leaf": [[10, 20], [30, 18], [32, 40], [12, 38]]}}; for '
            'wires "closed": false and "width": their width.',
        },
        "learned": {
            "type": Path,
            "help": "Shape space and dynamics of contours, from `jaxpf contour learn`.",
        },
    }

    def start(self, given: Contours, names: Any = None) -> ContourStart:
        if names is not None:
            given = dataclasses.replace(given, names=tuple(names))
        return contour_start(given)

    def likelihood(self, options: Options, start: Start, looks: Looks) -> "LikelihoodLike":
        """Clutter is learned from ``looks.typical``."""
        from jaxpf.contract.pytree import as_array
        from jaxpf.likelihoods.contours import EdgeDetector, contours

        assert isinstance(start, ContourStart)
        width, space = options.wire_width, _space(options, start)
        likelihood = contours(
            space,
            start.num_partitions,
            exclusion=options.exclusion,
            frames=looks.typical if options.clutter is None else None,
            clutter=options.clutter,
            detector=EdgeDetector(
                threshold=options.edge_threshold,
                length=options.line_length,
                smoothing=options.edge_smoothing,
            ),
            sigma=options.sigma,
            independence=options.independence,
            width=start.contours.width if width is None else width,
            num_lines=options.lines,
        )
        slip: Any = options.slip
        if slip is None:
            share = _SLIP[start.contours.closed]
            slip = looks.settings.get("slip", share * start.contours.sizes)
        likelihood = dataclasses.replace(likelihood, slip=as_array(slip, float))
        if looks.frame is None:
            return likelihood
        return likelihood.started(looks.frame, space.project(start.contours.points))

    def model(self, options: Options, start: Start, likelihood: "LikelihoodLike") -> Model:
        """Substates are points of a shape space.

        Raises:
            InputError: options that conflict with the learned model.
        """
        from jaxpf.contours.models import contours_model

        assert isinstance(start, ContourStart)
        noise = options.noise_shift, options.noise_bend
        dynamics = start.learned and start.learned.dynamics_of(start.num_partitions)
        if dynamics is not None and noise != (None, None):
            raise InputError(
                "noise was given, but the learned file has dynamics of its own; leave one of them "
                "out, or learn again with --order 0."
            )
        return contours_model(
            likelihood,
            start.contours,
            _space(options, start),
            dynamics=dynamics,
            scale=np.where(
                [value is None for value in noise],
                start.contours.usual_noise,
                np.array(noise, float),
            ),
            flip=(FLIP if options.flip is None else options.flip) if options.hides else None,
        )

    @property
    def has_places(self) -> bool:
        """Every shape space begins with the shift of the centre."""
        return True

    def shapes(self, start: Start, estimate: "ArrayLike", tracker: "TrackerLike") -> np.ndarray:
        return shapes_of(tracker, estimate)

    def outlines(self, start: Start, shapes: "ArrayLike") -> "jax.Array | np.ndarray":
        """Polylines there and back, so that closing the polygon adds no line.

        These outlines are not convex; ``measures`` accounts for that.
        """
        import jax.numpy as jnp

        lines = polylines(jnp.asarray(shapes))
        return jnp.concatenate([lines, jnp.flip(lines, axis=-2)], axis=-2)

    def measures(self, start: Start, shapes: "ArrayLike", truth: "ArrayLike") -> dict[str, Any]:
        import jax.numpy as jnp

        from jaxpf.measures.polylines import measure_polylines

        return measure_polylines(polylines(jnp.asarray(shapes)), polylines(jnp.asarray(truth)))

    def read_start(self, given: Mapping[str, Any], number: int, source: "FrameSource") -> Start:
        if not given["contours"]:
            raise InputError(
                "no start contour: give --contours FILE.json with control points.  Draw contours "
                f"with `jaxpf mark {source.path} --target contours`."
            )
        contours = read_contours(given["contours"])
        learned = None
        if given["learned"]:
            from jaxpf.contours.learned_files import read_learned

            learned = read_learned(given["learned"])
        start = contour_start(contours, learned)
        for name, line in zip(contours.names, polylines(start.shapes), strict=True):
            seen = (line >= 0) & (line < (source.width, source.height))
            if not seen.all(axis=1).any():
                raise InputError(
                    f"contour '{name}' lies outside the frame of {source.width} x {source.height} "
                    "pixels: move it inside, or leave it out."
                )
        return start

    def fits_scene(self, scene: "Scene") -> bool:
        """Whether the ground truth has outlines."""
        return {"outlines", "closed"} <= set(scene.extras)

    def scene_shapes(self, scene: "Scene") -> np.ndarray:
        closed = bool(scene.extras["closed"])
        outlines = np.asarray(scene.extras["outlines"], float)
        lines = [_polyline(line, closed) for pair in outlines for line in pair]
        return np.reshape(lines, (*outlines.shape[:2], -1))

    def scene_start(self, scene: "Scene") -> Start:
        """Splines fitted to the outlines of the first frame."""
        closed = bool(scene.extras["closed"])
        outlines = scene.extras["outlines"][0]
        points = [fit_spline(line, _SCENE_POINTS[closed], closed=closed) for line in outlines]
        names = scene.extras.get("ids", range(1, len(outlines) + 1))
        width = None if closed else scene.parameters.get("wire_width")
        return contour_start(
            Contours(tuple(map(str, names)), np.array(points), closed=closed, width=width)
        )

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """The mean of the outline's points."""
        return polylines(shapes).mean(axis=-2)

    @contextlib.contextmanager
    def outline_file(self, path: Path, start: Start) -> Iterator[Callable[[int, np.ndarray], None]]:
        """CSV with the header ``frame,id,k,x,y,kind``."""
        inverse = np.zeros((0, PIECES + 1))  # without splines there are no control points
        contours = getattr(start, "contours", None)
        if contours is not None:
            places = even_places(PIECES + 1, closed=False)
            kind: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
            # The control points follow from the points on the spline, which are more.
            inverse = np.linalg.pinv(basis(places, contours.points.shape[1], **kind))

        with ContourTrackWriter(path) as writer:

            def append(frame: int, shapes: np.ndarray) -> None:
                lines = polylines(np.asarray(shapes, float))
                writer.append(frame, start.ids, inverse @ lines, lines)

            yield append

    def draw(self, frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
        from jaxpf.media.overlay import draw_outlines

        lines = polylines(np.asarray(shapes))
        return draw_outlines(frame, lines, start.ids, marks.colours, marks.lost, marks.doubtful)

    def draw_particles(
        self, frame: np.ndarray, start: Start, tracker: Any, state: Any, colours: np.ndarray
    ) -> np.ndarray:
        """Contours of the likeliest particles, occluded parts dark and dashed."""
        from jaxpf.contours.drawing import draw_contour_particles

        log_weights = np.asarray(state.log_weights)
        best = np.argsort(log_weights)[::-1][:_DRAWN]
        lines = polylines(self.shapes(start, np.asarray(state.substates)[best], tracker))
        hidden, orders = None, optional(tracker.likelihood, "orders_of_labels")
        if getattr(state, "label", None) is not None and orders is not None:
            hidden = _hidden(lines, [orders[label] for label in np.asarray(state.label)[best]])
        return draw_contour_particles(frame, lines, np.exp(log_weights[best]), hidden, colours)


CONTOURS = _ContourTarget()


def contour_start(contours: Contours, learned: Learned | None = None) -> ContourStart:
    """Build the start of contours from control points and an optional learned model."""
    kind: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
    lines = points_on(contours.points, PIECES + (not contours.closed), **kind)
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


def shapes_of(tracker: Any, estimate: Any) -> np.ndarray:
    """Convert estimates to shapes ``[..., P, S]`` with the tracker's shape space.

    Raises:
        InputError: a user-defined likelihood without a shape space.
    """
    check_tracker(tracker)
    space = optional(tracker.likelihood, "space")
    if space is None:
        raise InputError(
            "this tracker's likelihood does not define the shape space; give it an attribute "
            "`space`, such as jaxpf.shapes.space_of makes."
        )
    check_array("estimate", estimate, f"coordinates, [..., P, {space.dimension}]")
    kind: dict[str, Any] = {"closed": space.closed, "degree": space.degree}
    matrix = basis(even_places(PIECES + 1, closed=False), space.num_points, **kind)
    lines = matrix @ np.asarray(space.control_points(np.asarray(estimate)), float)
    if space.closed:
        lines[..., -1, :] = lines[..., 0, :]
    return lines.reshape(*lines.shape[:-2], -1)


def _space(options: Options, start: ContourStart) -> "ShapeSpace":
    """Return the learned shape space, or the requested one."""
    from jaxpf.contours.models import start_space

    if start.learned is not None and options.shape_space is not None:
        raise InputError(
            f"the shape space {options.shape_space} was asked for and a learned one was given; "
            "leave one of them out."
        )
    space = options.shape_space or "similarity"
    return start_space(start.contours, start.learned.space if start.learned else space)


def polylines(shapes: Any) -> Any:
    """Reshape shapes ``[..., P, 2 V]`` to polylines ``[..., P, V, 2]``."""
    return shapes.reshape(*shapes.shape[:-1], -1, 2)


def _polyline(outline: np.ndarray, closed: bool) -> np.ndarray:
    """A shape ``[2 V]`` from an outline ``[S, 2]``; NaN where it is not finite."""
    if not np.isfinite(outline).all():
        return np.full(2 * (PIECES + 1), np.nan)
    even = resample_polyline(outline, PIECES + (not closed), closed=closed)
    return np.concatenate([even, even[:1]] if closed else [even]).ravel()


def _hidden(lines: np.ndarray, orders: Sequence[Sequence[int]]) -> np.ndarray:
    """Which points of ``[n, P, V, 2]`` lie inside a nearer contour, by orders, nearest first."""
    import cv2

    is_hidden = np.zeros(lines.shape[:3], bool)
    for hidden, outlines, order in zip(is_hidden, lines, orders, strict=True):
        for nearer, farther in combinations(order, 2):
            if np.isfinite(outlines[[nearer, farther]]).all():
                outline = outlines[nearer].astype(np.float32)[:, None]
                hidden[farther] |= [
                    cv2.pointPolygonTest(outline, (float(x), float(y)), False) > 0
                    for x, y in outlines[farther]
                ]
    return is_hidden
