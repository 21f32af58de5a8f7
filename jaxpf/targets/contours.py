"""Contours: targets that are told by their outlines, look-alikes among them (maccormick1999).

A substate is a point of a shape space, ``jaxpf.models.shapes``; all coordinates are in pixels.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.files.contours import Contours
from jaxpf.files.writing import LineWriter
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.dynamics import RandomWalk
from jaxpf.models.likelihoods.contours import EXCLUSIONS, EdgeDetector, contours
from jaxpf.models.occlusion import FLIP, WithOcclusion
from jaxpf.models.shapes import ShapeSpace, space_of
from jaxpf.pytree import is_concrete

METHODS = ("sir", "ps")
#: Noise of every coordinate per frame, pixels: the shift's, and that of the shape.
DEFAULT_SCALE = (3.0, 1.0)
TRACK_HEADER = "frame,contour,kind,point,x,y"


def contours_tracker(
    start: Contours,
    frames: Any,
    *,
    space: str | ShapeSpace = "similarity",
    method: str = "ps",
    exclusion: str = "wires",
    dynamics: Any = None,
    scale: ArrayLike = DEFAULT_SCALE,
    detector: EdgeDetector | None = None,
    clutter: Any = None,
    sigma: float = 7.0,
    num_lines: int = 32,
    flip: float = FLIP,
    num_particles: int = 500,
    resampling: str = "systematic",
) -> Partitioned:
    """A tracker of contours that starts at given ones.

    Args:
        start: control points just before the first frame, from ``jaxpf.files.contours``.
        frames: uint8 RGB ``[T, H, W, 3]``, from which clutter is learned; not used if ``clutter``
            is given.
        space: ``"translation"``, ``"similarity"`` or ``"affine"``, of each contour's start; or a
            space learned from key frames, which must hold the start.
        method: one of ``METHODS``.  Partitioned sampling of opaque targets is branched: a
            particle places the target first that it believes to be in front.
        exclusion: ``"wires"``, ``"opaque"`` (two closed contours) or ``"none"``.
        dynamics: such as ``jaxpf.dynamics.fit`` learns; default a random walk.
        scale: of that walk: noise of the shift and of every other coordinate, ``[2]``, or of each
            coordinate, ``[D]``; pixels.
        detector: of edges.
        clutter: see ``jaxpf.models.likelihoods.contours.contours``.
        sigma: width of the law of a boundary's feature, pixels.
        num_lines: measurement lines per contour.
        flip: of opaque targets, probability per frame that they change their order in depth.
        num_particles: N.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.

    Raises:
        InputError: an argument is out of range; the sentence says which.
    """
    if method not in METHODS:
        raise InputError(
            f"method {method!r} is unknown for contours; choose one of {', '.join(METHODS)}."
        )
    if exclusion not in EXCLUSIONS:
        raise InputError(f"exclusion {exclusion!r} is unknown; choose one of {list(EXCLUSIONS)}.")
    num_targets = len(start.names)
    if isinstance(space, str):
        space = space_of(space, start.points, closed=start.closed, degree=start.degree)
    elif np.shape(space.template)[1] != start.points.shape[1] or space.closed != start.closed:
        raise InputError(
            f"the start's contours have {start.points.shape[1]} control points and the shape "
            f"space's {np.shape(space.template)[1]}; give both the same, closed or open."
        )
    likelihood = contours(
        space,
        num_targets,
        exclusion=exclusion,
        frames=frames if clutter is None else None,
        clutter=clutter,
        detector=detector,
        sigma=sigma,
        width=start.width,
        num_lines=num_lines,
    )
    if dynamics is None:
        dynamics = RandomWalk(scale=_noise(scale, space.dimension))
    ordering = orderings.ps(list(range(num_targets)))
    label = None
    if method == "sir":
        ordering = orderings.sir(num_targets)
    if exclusion == "opaque":
        if is_concrete(flip) and not 0 <= np.asarray(flip) <= 1:
            raise InputError(f"flip {flip} must be a probability, 0 to 1.")
        dynamics, label = WithOcclusion(dynamics, likelihood, flip), np.full(2, 0.5, np.float32)
        if method == "ps":
            ordering = orderings.branched([[0, 1], [1, 0]])
    return Partitioned(
        dynamics=dynamics,
        likelihood=likelihood,
        ordering=ordering,
        initial=space.project(start.points).astype(np.float32),
        initial_label=label,
        num_particles=num_particles,
        resampling=resampling,
    )


def outlines(tracker: Partitioned, estimates: ArrayLike) -> np.ndarray:
    """Polylines ``[..., P, M, 2]`` of estimates ``[..., P, D]``, pixels.

    Args:
        tracker: from ``contours_tracker``; its space says whether the last point joins the first.
        estimates: such as ``summary.estimate``.
    """
    return np.asarray(tracker.likelihood.outline_points(np.asarray(estimates)))


class ContourTrackWriter(LineWriter):
    """Append tracks of contours, frame by frame; after every frame the file holds whole lines only.

    CSV with the header ``frame,contour,kind,point,x,y``: of every contour the points of kind
    ``control``, which ``jaxpf.files.contours`` reads, and those of kind ``outline``, to draw.
    """

    def __init__(self, path: str | os.PathLike[str]):
        """Create the file and write its header.

        Raises:
            InputError: it cannot be written.
        """
        super().__init__(path)
        self.write_lines(f"{TRACK_HEADER}\n")

    def append(self, frame: int, names: Any, tracker: Partitioned, estimate: ArrayLike) -> None:
        """Write the contours of one frame.

        Args:
            frame: counting from 0.
            names: ``[P]``.
            tracker: from ``contours_tracker``.
            estimate: ``[P, D]``; a target whose substate is not finite is left out.

        Raises:
            InputError: the disk is full or the file cannot be written.
        """
        estimate = np.asarray(estimate)
        kinds = {
            "control": np.asarray(tracker.likelihood.space.control_points(estimate)),
            "outline": outlines(tracker, estimate),
        }
        lines = [
            f"{int(frame)},{name},{kind},{number},{x:.3f},{y:.3f}\n"
            for target, name in enumerate(names)
            if np.isfinite(estimate[target]).all()
            for kind, points in kinds.items()
            for number, (x, y) in enumerate(points[target])
        ]
        self.write_lines("".join(lines))


def _noise(scale: ArrayLike, dimension: int) -> np.ndarray:
    """``[D]``."""
    values = np.asarray(scale, np.float32)
    if values.shape == (2,):
        values = np.concatenate([np.full(2, values[0]), np.full(dimension - 2, values[1])])
    if values.shape != (dimension,) or not np.isfinite(values).all() or (values < 0).any():
        raise InputError(
            f"scale {np.asarray(scale).tolist()} must be two finite numbers >= 0, of the shift and "
            f"of the shape in pixels, or one for each of the {dimension} coordinates."
        )
    return values
