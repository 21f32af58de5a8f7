"""The contour target: objects, including look-alikes, recognised by outline (maccormick1999).

A contour is a partition whose substate is a point of a shape space, such as those of
``jaxpf.shapes.spaces``; all coordinates are in pixels.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.contours.data import Contours, Learned
from jaxpf.contract.errors import Argument, InputError, check_tracker
from jaxpf.contract.model import Model
from jaxpf.contract.names import EXCLUSIONS, SHAPE_SPACES
from jaxpf.contract.numbers import check_array
from jaxpf.contract.options import check_options, option, plain
from jaxpf.shapes.splines import basis, even_places, points_on
from jaxpf.targets.appearance import slip_option
from jaxpf.targets.target import Looks, Start, Target

#: Number of segments of a reported polyline.
PIECES = 64
#: The depth order of separate contours is unknown; few particles would keep an arbitrary one.
_FLIP = 0.5
#: Default slip on film of open and of closed contours, as a share of their size; see
#: "Contours" in docs/development/defaults.md.
_SLIP = {False: 0.1, True: 0.05}


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the contour model; see the help of each."""

    shape_space: str | None = option(
        None,
        "How shapes may change: translation, similarity (default; also turns and scales) or "
        "affine.  Other shapes are learned, see --learned.",
        kind=str,
        choices=SHAPE_SPACES,
        common=True,
        compiles=True,
    )
    shift_noise: float | None = option(
        None,
        "Noise of the shift in x and y per frame, in pixels; by default 0.05 of the contour's "
        "size, or learned (contours only).  The size is the side of a square with the diagonal of "
        "the bounding box of the control points.",
        kind=float,
        least=0,
    )
    bend_noise: float | None = option(
        None,
        "Noise of every other coordinate of the shape per frame, in pixels by which points of the "
        "contour move; by default 0.006 of the contour's size, or learned (contours only).",
        kind=float,
        least=0,
    )
    exclusion: str = option(
        "wires",
        "Whether an edge may belong to several contours: wires (to one only), opaque or none.  "
        "opaque is for two to four closed contours, of which nearer ones hide others; with none, "
        "look-alikes coalesce.  In wires-literal, opaque-literal and none-literal, as published, "
        "every line near an edge counts it.",
        choices=EXCLUSIONS,
        common=True,
        compiles=True,
    )
    wire_width: float | None = option(
        None,
        "Width in pixels of a wire with two visible edges; by default that of the file (open "
        "contours only).",
        kind=float,
        above=0,
    )
    lines: int = option(
        32,
        "Number of measurement lines on a contour (contours only).",
        least=4,
        most=1000,
        compiles=True,
    )
    line_length: int = option(
        41,
        "Length of a measurement line, an odd number of pixels: edges are found up to half of it "
        "away (contours only).",
        least=3,
        most=253,
        compiles=True,
    )
    edge_threshold: float = option(
        8.0, "Weakest edge that counts, in grey levels per pixel (contours only).", least=0
    )
    edge_smoothing: float = option(
        1.0,
        "Blur of the frame before edges are found, in pixels (contours only).",
        least=0,
        most=20,
        compiles=True,
    )
    sigma: float = option(
        7.0,
        "Standard deviation of an edge's distance from the contour, in pixels (contours only).",
        above=0,
    )
    independence: float = option(
        0.3,
        "Weight of a measurement line's log likelihood: less than 1, since neighbouring lines see "
        "the same edge (contours only).  1 as published, where few particles keep any weight.",
        above=0,
        most=1,
    )
    clutter: float | None = option(
        None,
        "Mean number of edges on a measurement line of the background; by default the distribution "
        "of that number is learned from the start frame (contours only).",
        kind=float,
        above=0,
    )
    slip: float | None = slip_option()
    flip: float | None = option(
        None,
        "Probability per frame that two contours next to each other in depth change places, unless "
        f"they overlap; by default {_FLIP:g}, which forgets the order while they are apart (opaque "
        "contours only).  0.01 as published.",
        kind=float,
        least=0,
        most=1,
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.flip is not None and not self.hides:
            raise InputError(
                Argument("flip", plain(self.flip)),
                f" is of contours that hide one another, and exclusion is {self.exclusion!r}; "
                "choose exclusion 'opaque', or leave it out.",
            )
        if self.bend_noise is not None and self.shape_space == "translation":
            raise InputError(
                Argument("bend_noise", plain(self.bend_noise)),
                " is of shapes that change, and 'translation' only shifts them; leave one of them "
                "out.",
            )

    @property
    def hides(self) -> bool:
        """Whether contours occlude one another."""
        return self.exclusion.startswith("opaque")


@dataclasses.dataclass(frozen=True, eq=False)
class ContourStart(Start):
    """Start contours, with an optional learned model.

    Attributes:
        contours: their control points.
        learned: shape space and dynamics (``jaxpf.contours.Learned``), or None.
    """

    contours: Contours
    learned: Learned | None = None


class ContourTarget(Target):
    """Contours as a target.

    A shape is a polyline x, y, x, y, ... in pixels; a closed contour's last point equals its first.
    """

    name = "contours"
    options = Options
    defaults: Mapping[str, Any] = {"method": "ps", "particles": 500}
    unsuited = ("sps",)  # exclusion weighs contours together

    def start(self, given: Contours, names: Any = None) -> ContourStart:
        """See ``Target``."""
        if names is not None:
            given = dataclasses.replace(given, names=tuple(names))
        return contour_start(given)

    def likelihood(self, options: Options, start: Start, looks: Looks) -> Any:
        """See ``Target``; clutter is learned from ``looks.typical``."""
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

    def model(self, options: Options, start: Start, likelihood: Any) -> Model:
        """See ``Target``; substates are points of a shape space.

        Raises:
            InputError: options that conflict with the learned model.
        """
        from jaxpf.contours.models import contours_model

        assert isinstance(start, ContourStart)
        noise = options.shift_noise, options.bend_noise
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
            flip=(_FLIP if options.flip is None else options.flip) if options.hides else None,
        )

    @property
    def has_places(self) -> bool:
        """See ``Target``: every shape space begins with the shift of the centre."""
        return True

    def shapes(self, start: Start, estimate: Any, tracker: Any) -> np.ndarray:
        """See ``Target``."""
        return shapes_of(tracker, estimate)

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``: polylines there and back, so that closing the polygon adds no line.

        These outlines are not convex; ``measures`` accounts for that.
        """
        import jax.numpy as jnp

        lines = polylines(jnp.asarray(shapes))
        return jnp.concatenate([lines, jnp.flip(lines, axis=-2)], axis=-2)

    def measures(self, start: Start, shapes: Any, truth: Any) -> dict[str, Any]:
        """See ``Target``."""
        import jax.numpy as jnp

        from jaxpf.measures.polylines import measure_polylines

        return measure_polylines(polylines(jnp.asarray(shapes)), polylines(jnp.asarray(truth)))


CONTOURS = ContourTarget()


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
    space = getattr(tracker.likelihood, "space", None)
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


def _space(options: Options, start: ContourStart) -> Any:
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
