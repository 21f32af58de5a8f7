"""Make a contour likelihood: check arguments and set defaults."""

from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError, check_known, check_type
from jaxpf.contract.names import EXCLUSIONS
from jaxpf.contract.numbers import check_array, check_whole
from jaxpf.contract.pytree import as_array
from jaxpf.contract.ranges import check_ranges
from jaxpf.likelihoods.contours.clutter import check_clutter, learn_clutter, poisson_clutter
from jaxpf.likelihoods.contours.edges import EdgeDetector
from jaxpf.likelihoods.contours.exclusive import ExclusiveContours, OpaqueContours
from jaxpf.likelihoods.contours.likelihood import IndependentContours
from jaxpf.likelihoods.contours.line_model import SIGMA, check_detection, detection_probabilities
from jaxpf.shapes.depth import depth_orders
from jaxpf.shapes.spaces import ShapeSpace

_KINDS: dict[str, tuple[type[IndependentContours], dict[str, str]]] = {
    "wires": (ExclusiveContours, {}),
    "opaque": (OpaqueContours, {}),
    "none": (IndependentContours, {}),
    "none-literal": (IndependentContours, {"payment": "literal"}),
    "wires-literal": (ExclusiveContours, {"payment": "literal"}),
    "opaque-literal": (OpaqueContours, {"payment": "literal"}),
}
#: More boundaries on a line would make too many subsets to sum over.
_MOST_CROSSINGS = 8


def contours(
    space: ShapeSpace,
    num_targets: int,
    *,
    exclusion: str = "wires",
    frames: Any = None,
    clutter: Any = None,
    detector: EdgeDetector | None = None,
    detection: Any = None,
    sigma: float = SIGMA,
    independence: float = 1.0,
    width: float | None = None,
    num_lines: int = 32,
    crossings: int | None = None,
) -> IndependentContours:
    """The likelihood of contours from edges on their normals (maccormick1999).

    Args:
        space: the shape space of the substates.
        num_targets: P; 2 to 4 if opaque.
        exclusion: one of ``EXCLUSIONS``: ``"wires"`` or ``"opaque"``, where an edge is rewarded
            once; ``"none"``, the paper's control, where it is rewarded once per target.
            ``"wires-literal"``, ``"opaque-literal"`` and ``"none-literal"`` reward it on every
            line that shows it, as printed (eq. 2 and 5).
        frames: uint8 RGB ``[T, H, W, 3]``, from which clutter is learned; give this or
            ``clutter``.
        clutter: either b(n) for n = 0 .. max_features, or the mean of Poisson clutter, features
            per line.
        detector: of edges; its ``length`` is L.
        detection: probabilities that k of c boundaries are detected, ``[c, k]``, for c from 0 to
            the most boundaries on a line; default ``detection_probabilities``.
        sigma: standard deviation of a boundary's feature, pixels.
        independence: weight of each line's log-ratio, above 0 to 1; use less than 1 if lines are
            so close together that they see the same edge.  Each line is still a density, so the
            evidence may choose among weights.  This does not hold for the literal likelihoods or
            with further ``crossings``, and only approximately in some other cases, see ``share``.
        width: of a wire with two visible edges, pixels; None: the contour is one edge.
        num_lines: M, lines per contour.
        crossings: maximum number of crossings of one contour with one line that are used;
            default 1, or 2 for a wire with two edges.

    Raises:
        InputError: an argument is out of range.
    """
    detector = EdgeDetector() if detector is None else detector
    check_type("detector", detector, EdgeDetector)
    edges = 1 if width is None else 2
    crossings = edges if crossings is None else crossings
    _check(space, num_targets, exclusion, sigma, independence, width, num_lines, crossings, edges)
    if width is not None and width >= detector.length:
        raise InputError(
            f"width {width:g} does not fit on lines of {detector.length} pixels; give the detector "
            "a greater length."
        )
    if (frames is None) == (clutter is None):
        raise InputError("give either frames to learn clutter from, or the clutter itself.")
    if frames is not None:
        clutter = learn_clutter(frames, detector)
    else:
        check_array("clutter", clutter, "the mean number of features, or b(n)")
        if np.ndim(clutter) == 0:
            clutter = poisson_clutter(float(clutter), detector.max_features)
    kind, payment = _KINDS[exclusion]
    together = crossings * (num_targets if issubclass(kind, ExclusiveContours) else 1)
    together += 0 if payment else edges
    detection = detection_probabilities(together) if detection is None else detection
    detection = check_detection(detection)
    if len(detection) <= together:
        raise InputError(
            f"detection speaks of at most {len(detection) - 1} boundaries on a line, but "
            f"{together} may cross it; give {together + 1} rows."
        )
    options: dict[str, Any] = dict(payment)
    if issubclass(kind, OpaqueContours):
        options["num_targets"] = num_targets
    return kind(
        space=space,
        detector=detector,
        clutter=check_clutter(clutter, detector.max_features),
        detection=as_array(detection, float),
        sigma=sigma,
        independence=independence,
        width=0.0 if width is None else width,
        edges=edges,
        num_lines=num_lines,
        crossings=crossings,
        **options,
    )


def _check(
    space, num_targets, exclusion, sigma, independence, width, num_lines, crossings, edges
) -> None:
    check_known("exclusion=", exclusion, EXCLUSIONS)
    check_ranges(sigma=sigma, independence=independence, num_lines=num_lines)
    check_ranges(width=1.0 if width is None else width)
    check_whole("num_targets", num_targets)
    check_whole("crossings", crossings, edges)
    if not hasattr(space, "num_templates"):
        check_type("space", space, ShapeSpace)
    if edges == 2 and space.closed:
        raise InputError(
            f"width {width:g} is of wires with two edges, which are open contours, and these are "
            "closed; leave the width out, or give open contours."
        )
    if issubclass(_KINDS[exclusion][0], OpaqueContours):
        depth_orders(num_targets)
        if not space.closed:
            raise InputError(
                f"{num_targets} opaque target(s) with open contours: what is hidden follows from "
                "what lies inside a nearer target's closed contour; give closed contours, or treat "
                "the targets as wires."
            )
    exclusive = issubclass(_KINDS[exclusion][0], ExclusiveContours)
    most = crossings * (num_targets if exclusive else 1)
    if most > _MOST_CROSSINGS:
        raise InputError(
            f"up to {most} boundaries could cross a line, {crossings} of each of {num_targets} "
            f"contours, and {_MOST_CROSSINGS} is the most; track fewer contours together, or use "
            "exclusion='none'."
        )
    if space.num_templates not in (1, num_targets):
        raise InputError(
            f"the shape space has {space.num_templates} templates; give one for all "
            f"targets, or {num_targets}."
        )
