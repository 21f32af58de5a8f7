"""Make a contour likelihood, and learn its clutter.

Clutter is the distribution of the number of features on a line without a target, b(n) of
maccormick1999.  It is learned from lines at random places and in random directions of typical
frames, or Poisson with a given mean.  Learned counts are smoothed by a geometric distribution with
the same mean, so that no line has an infinite log-ratio.  Counts above the largest that is kept are
added to that one.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import TINY, check_number, check_whole
from jaxpf.contract.pytree import as_array
from jaxpf.likelihoods.contours.edges import EdgeDetector, Lines
from jaxpf.likelihoods.contours.exclusive import ExclusiveContours, OpaqueContours
from jaxpf.likelihoods.contours.likelihood import IndependentContours
from jaxpf.likelihoods.contours.line_model import SIGMA, detection_probabilities
from jaxpf.lowering.programs import compiled
from jaxpf.shapes.depth import depth_orders
from jaxpf.shapes.spaces import ShapeSpace

#: Exclusion between contours: as wire frames, as opaque bodies, or none; the ``-literal`` variants
#: follow maccormick1999 as printed.
EXCLUSIONS = ("wires", "opaque", "none", "wires-literal", "opaque-literal", "none-literal")

_KINDS: dict[str, type[IndependentContours]] = {
    "wires": ExclusiveContours,
    "opaque": OpaqueContours,
    "none": IndependentContours,
}
#: More boundaries on a line would make too many subsets to sum over.
_MOST_CROSSINGS = 8
#: Weight of the geometric distribution, in lines, added to the counts of clutter.
_SMOOTHING = 5.0
#: Lines, divided among the frames, from which clutter is learned.
_LINES = 4000


def contours(
    space: ShapeSpace,
    num_targets: int,
    *,
    exclusion: str = "wires",
    frames: Any = None,
    clutter: Any = None,
    detector: EdgeDetector | None = None,
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
        sigma: standard deviation of a boundary's feature, pixels.
        independence: weight of each line's log-ratio, above 0 to 1; use less than 1 if lines are
            so close together that they see the same edge.  Each line is still a density, so the
            evidence may choose among weights.  This does not hold for the literal likelihoods or
            with further ``crossings``, and only approximately in some other cases, see ``share``.
        width: of a wire with two visible edges, pixels; None: the contour is one edge.
        num_lines: M, lines per contour.
        crossings: maximum number of crossings of one contour with one line that are used;
            default 1, or 2 for a wire with two edges.
    """
    check_known("exclusion=", exclusion, EXCLUSIONS)
    check_number("sigma", sigma, above=0)
    check_number("independence", independence, above=0, most=1)
    check_whole("num_lines", num_lines, 4, 1000)
    name, _, literal = exclusion.partition("-")
    kind, is_opaque = _KINDS[name], name == "opaque"
    detector = EdgeDetector() if detector is None else detector
    edges = 1
    if width is not None:
        check_number("width", width, above=0)
        edges = 2
        if space.closed:
            raise InputError(
                f"width {width:g} is of wires with two edges, which are open contours, and these "
                "are closed; leave the width out, or give open contours."
            )
        if width >= detector.length:
            raise InputError(
                f"width {width:g} does not fit on lines of {detector.length} pixels; give the "
                "detector a greater length."
            )
    if is_opaque:
        depth_orders(num_targets)
        if not space.closed:
            raise InputError(
                f"{num_targets} opaque target(s) with open contours: what is hidden follows from "
                "what lies inside a nearer target's closed contour; give closed contours, or treat "
                "the targets as wires."
            )
    crossings = edges if crossings is None else crossings
    check_whole("crossings", crossings, edges)
    together = crossings * (1 if name == "none" else num_targets)
    if together > _MOST_CROSSINGS:
        raise InputError(
            f"up to {together} boundaries could cross a line, {crossings} of each of {num_targets} "
            f"contours, and {_MOST_CROSSINGS} is the most; track fewer contours together, or use "
            "exclusion='none'."
        )
    together += 0 if literal else edges
    if frames is not None:
        clutter = learn_clutter(frames, detector)
    elif np.ndim(clutter) == 0:
        clutter = poisson_clutter(clutter, detector.max_features)
    options: dict[str, Any] = {"num_targets": num_targets} if is_opaque else {}
    return kind(
        space=space,
        detector=detector,
        clutter=_checked(clutter),
        detection=as_array(detection_probabilities(together), float),
        sigma=sigma,
        independence=independence,
        width=0.0 if width is None else width,
        edges=edges,
        num_lines=num_lines,
        crossings=crossings,
        reward="literal" if literal else "once",
        **options,
    )


def poisson_clutter(mean: float, max_features: int) -> jax.Array:
    """b(n) for n = 0 .. max_features of Poisson clutter, ``[max_features + 1]``.

    On lines with fewer than ``max_features`` features, the line model has the ratios of the full
    distribution, ``(L / mean)^k``; a line with ``max_features`` may have shown more.

    Args:
        mean: features per line.
        max_features: the detector's.
    """
    check_number("clutter", mean, above=0)
    counts = np.arange(max_features + 1)
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(counts[1:]))])
    law = np.exp(counts * np.log(mean) - mean - log_factorial)
    if law.min() < np.finfo(np.float32).tiny:
        raise InputError(
            f"clutter of mean {mean:g} features per line makes 0 to {max_features} features "
            "impossible in 32 bits; give a mean between, such as 0.1 to 10."
        )
    return as_array(law, float)


def learn_clutter(frames: ArrayLike, detector: EdgeDetector) -> jax.Array:
    """b(n) for n = 0 .. max_features from random lines of frames, ``[max_features + 1]``.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``.
        detector: the likelihood's detector.
    """
    frames = np.asarray(frames)
    height, width = frames.shape[1:3]
    if min(height, width) <= detector.length:
        raise InputError(
            f"lines of {detector.length} pixels do not fit into frames of {width} x {height}; take "
            "shorter lines."
        )
    rng = np.random.default_rng(0)
    counts = np.zeros(detector.max_features + 1)
    find = compiled(lambda frame, lines: detector.find(detector.observe(frame), lines).present)
    each = -(-_LINES // len(frames))
    for frame in frames:
        angle = rng.uniform(0, np.pi, each)
        reach = detector.reach * np.abs([np.cos(angle), np.sin(angle)])
        x, y = (rng.uniform(r, size - r) for r, size in zip(reach, (width, height), strict=True))
        lines = Lines(*(jnp.asarray(v, jnp.float32) for v in (x, y, np.cos(angle), np.sin(angle))))
        numbers = np.asarray(find(jnp.asarray(frame), lines)).sum(axis=0)
        counts += np.bincount(numbers, minlength=len(counts))
    total = counts.sum()
    mean = counts @ np.arange(len(counts)) / total
    if mean == 0:
        raise InputError(
            f"none of {total:.0f} random lines shows an edge above the threshold "
            f"{float(detector.threshold):g}, so that clutter cannot be learned; lower the "
            "threshold, or give clutter, the mean number of edges on a line."
        )
    geometric = (mean / (1 + mean)) ** np.arange(len(counts))
    smoothed = counts + _SMOOTHING * geometric / geometric.sum()
    return as_array(smoothed / smoothed.sum(), float)


def _checked(clutter: ArrayLike) -> jax.Array:
    """Convert b(n); refuse what is not above 0, or sums to more than 1."""
    values = np.asarray(clutter, float)
    if not (values >= TINY).all() or values.sum() > 1 + 1e-5:
        raise InputError(
            f"clutter {values.round(6).tolist()} must be above 0 and sum to 1 or less; smooth it, "
            "as learn_clutter does."
        )
    return as_array(values, float)
