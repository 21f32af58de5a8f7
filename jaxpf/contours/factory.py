"""Builds trackers of contours: objects, look-alikes included, known by outline (maccormick1999).

A contour is a partition whose substate is a point of a shape space, such as those of
``jaxpf.shapes.spaces``; all coordinates are in pixels.
"""

import dataclasses
from typing import Annotated, Any, Literal, Unpack

import jax
import numpy as np
from numpy.typing import ArrayLike

from jaxpf import filters
from jaxpf.contours.files import Contours, Learned
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.model import Model
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import Option
from jaxpf.contract.pytree import as_array
from jaxpf.contract.types import LikelihoodLike, TrackerLike
from jaxpf.dynamics.gaussian import RandomWalk
from jaxpf.dynamics.occlusion import WithOcclusion
from jaxpf.likelihoods.contours import EdgeDetector, contours as contours_likelihood
from jaxpf.shapes.depth import depth_orders
from jaxpf.shapes.spaces import ShapeSpace, space_of
from jaxpf.shapes.splines import basis, even_places
from jaxpf.targets.building import TrackerOptions, factory, looks_of
from jaxpf.targets.target import Looks, Start

#: Number of segments of a reported polyline.
PIECES = 64
#: Default slip on film of open and of closed contours, as a share of their size; see
#: "Contours" in docs/development/defaults.md.
_SLIP = {False: 0.1, True: 0.05}
#: Noise per frame of the shift and of the other coordinates, as a share of a contour's size.
_NOISE = 0.05, 0.006
#: The depth order of separate contours is unknown; few particles would keep an arbitrary one.
_FLIP = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class ContourStart(Start):
    """Start contours, with an optional learned model.

    Attributes:
        contours: their control points.
        learned: shape space and dynamics (``jaxpf.contours.files.Learned``), or None.
    """

    contours: Contours
    learned: Learned | None = None


@factory("contours")
def tracker(
    frame: ArrayLike | Looks | None,
    contours: Contours | Start,
    *,
    likelihood: LikelihoodLike | None = None,
    learned: Learned | None = None,
    shape_space: Annotated[
        Literal["translation", "similarity", "affine"] | None,
        Option(
            "How shapes may change: translation, similarity (default; also turns and scales) or "
            "affine.  Other shapes are learned, see --learned.",
            compiles=True,
        ),
    ] = None,
    noise_shift: Annotated[
        float | None,
        Option(
            "Noise of the shift in x and y per frame, in pixels; by default 0.05 of the contour's "
            "size, or learned.  The size is the side of a square with the diagonal of the bounding "
            "box of the control points.",
            least=0,
        ),
    ] = None,
    noise_bend: Annotated[
        float | None,
        Option(
            "Noise of every other coordinate of the shape per frame, in pixels by which points of "
            "the contour move; by default 0.006 of the contour's size, or learned.",
            least=0,
        ),
    ] = None,
    exclusion: Annotated[
        Literal["wires", "opaque", "none", "wires-literal", "opaque-literal", "none-literal"],
        Option(
            "Whether an edge may belong to several contours: wires (to one only), opaque or none.  "
            "opaque is for two to four closed contours, of which nearer ones hide others; with "
            "none, look-alikes coalesce.  In wires-literal, opaque-literal and none-literal, as "
            "published, every line near an edge counts it.",
            compiles=True,
        ),
    ] = "wires",
    wire_width: Annotated[
        float | None,
        Option(
            "Width in pixels of a wire with two visible edges; by default that of the file (open "
            "contours only).",
            above=0,
            rare=True,
        ),
    ] = None,
    lines: Annotated[
        int,
        Option(
            "Number of measurement lines on a contour.",
            least=4,
            most=1000,
            compiles=True,
            rare=True,
        ),
    ] = 32,
    line_length: Annotated[
        int,
        Option(
            "Length of a measurement line, an odd number of pixels: edges are found up to half of "
            "it away.",
            least=3,
            most=253,
            compiles=True,
            rare=True,
        ),
    ] = 41,
    edge_threshold: Annotated[
        float, Option("Weakest edge that counts, in grey levels per pixel.", least=0, rare=True)
    ] = 8.0,
    edge_smoothing: Annotated[
        float,
        Option(
            "Blur of the frame before edges are found, in pixels.",
            least=0,
            most=20,
            compiles=True,
            rare=True,
        ),
    ] = 1.0,
    sigma: Annotated[
        float,
        Option("Standard deviation of an edge's distance from the contour, in pixels.", above=0),
    ] = 7.0,
    independence: Annotated[
        float,
        Option(
            "Weight of a measurement line's log likelihood: less than 1, since neighbouring lines "
            "see the same edge.  1 as published, where few particles keep any weight.",
            above=0,
            most=1,
            rare=True,
        ),
    ] = 0.3,
    clutter: Annotated[
        float | None,
        Option(
            "Mean number of edges on a measurement line of the background; by default the "
            "distribution of that number is learned from the start frame.",
            above=0,
            rare=True,
        ),
    ] = None,
    slip: Annotated[
        float | None,
        Option(
            "Widens the intervals: standard deviation in pixels of a contour around its best "
            "match.  By default, as measured on film, 0.1 of the size for open contours and 0.05 "
            "for closed ones; 0 in synthetic scenes.",
            least=0,
        ),
    ] = None,
    flip: Annotated[
        float | None,
        Option(
            "Probability per frame that two contours next to each other in depth change places, "
            f"unless they overlap; by default {_FLIP:g}, which forgets the order while they are "
            "apart (opaque contours only).  0.01 as published.",
            least=0,
            most=1,
            needs=("exclusion", "opaque", "opaque-literal"),
            rare=True,
        ),
    ] = None,
    **options: Unpack[TrackerOptions],
) -> Any:
    """Build the contour tracker of ``jaxpf track``.

    Opaque targets carry a label for their order in depth, and partitioned sampling is branched:
    each particle samples first the target that it believes to be nearest.  Example::

        leaf = [[100, 60], [140, 70], [160, 110], [130, 150], [90, 140], [70, 100]]
        contours = jaxpf.contours.Contours(names=("leaf",), points=[leaf])
        tracker = jaxpf.contours.tracker(frames[0], contours)
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.contours.to_contours(tracker, summary.estimate)  # [T, P, V, 2]: x, y

    Options without an entry here are explained in the signature.

    Args:
        frame: uint8 RGB ``[H, W, 3]``, from which clutter is learned; tracking continues with the
            next frame.  It may be None with a user-defined likelihood.
        contours: the start contours.
        likelihood: a user-defined likelihood of points of the shape space.
        learned: shape space and dynamics.
        options: ``like="maccormick1999"`` for that paper's system as printed; ``method``, ``"ps"``
            (default) or ``"sir"``; ``num_particles``, default 500; and those of the method's
            filter: ``resampling``, ``joint_weighting``, ...
    """
    assert isinstance(contours, ContourStart), "by the decorator"
    given, count = contours.contours, contours.num_partitions
    if noise_bend is not None and shape_space == "translation":
        raise InputError(
            Argument("noise_bend", plain(noise_bend)),
            " works only with shapes that change, but 'translation' only shifts them; leave one "
            "of them out.",
        )
    space = _space(contours, shape_space)
    if likelihood is None:
        looks = looks_of(frame)
        typical = looks.frame[None] if looks.typical is None else looks.typical
        made = contours_likelihood(
            space,
            count,
            exclusion=exclusion,
            frames=typical if clutter is None else None,
            clutter=clutter,
            detector=EdgeDetector(
                threshold=edge_threshold, length=line_length, smoothing=edge_smoothing
            ),
            sigma=sigma,
            independence=independence,
            width=given.width if wire_width is None else wire_width,
            num_lines=lines,
        )
        usual = looks.settings.get("slip", _SLIP[given.closed] * given.sizes)
        made = dataclasses.replace(made, slip=as_array(usual if slip is None else slip, float))
        if looks.patches is None:
            made = made.started(looks.frame, space.project(given.points))
        likelihood = made
    dynamics: Any = contours.learned and contours.learned.dynamics
    noise = [noise_shift, noise_bend]
    if dynamics is None:
        usual = given.sizes[:, None] * _NOISE
        scale = np.where([value is None for value in noise], usual, np.array(noise, float))
        scale = np.repeat(scale.astype(np.float32), [2, space.dimension - 2], axis=1)
        dynamics = RandomWalk(scale=scale)
    elif noise != [None, None]:
        raise InputError(
            "noise was given, but the learned file has dynamics of its own; leave one of them out, "
            "or learn again with --order 0."
        )
    else:
        dynamics = jax.tree.map(lambda x: np.repeat(np.asarray(x)[:1], count, axis=0), dynamics)
    initial = space.project(given.points).astype(np.float32)
    model = Model(dynamics, likelihood, initial, contours.parents)
    if exclusion.startswith("opaque"):
        labels = len(depth_orders(count))
        model = model._replace(
            dynamics=WithOcclusion(dynamics, likelihood, _FLIP if flip is None else flip),
            initial_label=np.full(labels, 1 / labels, np.float32),
        )
    return filters.build(model, **options)


def _space(start: ContourStart, name: str | None) -> ShapeSpace:
    """The space of a name relative to each start contour, or the learned one."""
    given, learned = start.contours, start.learned
    if learned is None:
        kind: dict[str, Any] = {"closed": given.closed, "degree": given.degree}
        return space_of(name or "similarity", given.points, **kind)
    if name is not None:
        raise InputError(
            f"the shape space {name} was asked for and a learned one was given; leave one of them "
            "out."
        )
    space, count = learned.space, given.points.shape[1]
    if (space.num_points, space.closed) != (count, given.closed):
        kinds = ["closed" if closed else "open" for closed in (given.closed, space.closed)]
        raise InputError(
            f"the start's {kinds[0]} contours have {count} control points, and the shape space's "
            f"{kinds[1]} ones {space.num_points}; give both the same, as by "
            f"`jaxpf contour learn --points {count}`."
        )
    return space


def start(given: Contours) -> ContourStart:
    """Where contours start."""
    lines = polylines(given.points, given.closed, given.degree)
    return ContourStart(
        ids=np.asarray(given.names),
        shapes=lines.reshape(len(lines), -1),
        sizes=np.ptp(lines, axis=1),
        parents=(-1,) * len(lines),
        contours=given,
        remarks=given.remarks,
    )


def polylines(control: np.ndarray, closed: bool, degree: int) -> np.ndarray:
    """Points ``[..., V, 2]`` along splines; a closed contour's last point equals its first."""
    places = even_places(PIECES + 1, closed=False)
    lines = basis(places, control.shape[-2], closed=closed, degree=degree) @ control
    if closed:
        lines[..., -1, :] = lines[..., 0, :]
    return lines


def to_contours(tracker: TrackerLike, estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to polylines ``[..., P, V, 2]``, pixels.

    A closed contour's last point equals its first.

    Args:
        tracker: from ``tracker``.
        estimate: such as ``summary.estimate``.

    Raises:
        InputError: a user-defined likelihood without a shape space.
    """
    space: Any = optional(getattr(tracker, "likelihood", None), "space")
    if space is None:
        raise InputError(
            "this tracker's likelihood does not define the shape space; give it an attribute "
            "`space`, such as jaxpf.shapes.space_of makes."
        )
    control = np.asarray(space.control_points(np.asarray(estimate)), float)
    return polylines(control, space.closed, space.degree)
