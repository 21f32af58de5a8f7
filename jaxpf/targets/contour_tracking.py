"""Models and trackers of contours that start at given ones (maccormick1999)."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.files.contours import Contours
from jaxpf.filters.partitioned.options import PARTITIONED
from jaxpf.filters.partitioned.options import Options as FilterOptions
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.dynamics import RandomWalk
from jaxpf.models.likelihoods.contours import EdgeDetector, contours
from jaxpf.models.model import Model
from jaxpf.models.occlusion import FLIP, WithOcclusion
from jaxpf.models.shapes import space_of
from jaxpf.names import EXCLUSIONS
from jaxpf.pytree import is_concrete
from jaxpf.targets.contours import DEFAULT_SCALE

METHODS = ("sir", "ps")


def contours_model(
    start: Contours,
    frames: Any,
    *,
    space: Any = "similarity",
    exclusion: str = "wires",
    dynamics: Any = None,
    scale: ArrayLike = DEFAULT_SCALE,
    detector: EdgeDetector | None = None,
    clutter: Any = None,
    sigma: float = 7.0,
    independence: float = 1.0,
    num_lines: int = 32,
    flip: float = FLIP,
) -> Model:
    """Contours that start at given ones.

    Opaque targets carry a label that says which is in front, and partitioned sampling is branched:
    a particle places the target first that it believes to be in front.

    Args:
        start: control points just before the first frame, from ``jaxpf.files.contours``.
        frames: uint8 RGB ``[T, H, W, 3]``, from which clutter is learned; not used if ``clutter``
            is given.
        space: ``"translation"``, ``"similarity"`` or ``"affine"``, of each contour's start; or a
            space learned from key frames, which must hold the start.
        exclusion: ``"wires"``, ``"opaque"`` (two closed contours) or ``"none"``.
        dynamics: such as ``jaxpf.dynamics.fit`` learns; default a random walk.
        scale: of that walk: noise of the shift and of every other coordinate, ``[2]``, or of each
            coordinate, ``[D]``; pixels.
        detector: of edges.
        clutter: see ``jaxpf.models.likelihoods.contours.contours``.
        sigma: width of the law of a boundary's feature, pixels.
        independence: share of its log-ratio that each measurement line counts.
        num_lines: measurement lines per contour.
        flip: of opaque targets, probability per frame that they change their order in depth.

    Raises:
        InputError: an argument is out of range; the sentence says which.
    """
    if exclusion not in EXCLUSIONS:
        raise InputError(f"exclusion {exclusion!r} is unknown; choose one of {list(EXCLUSIONS)}.")
    num_targets, num_points = start.points.shape[:2]
    if isinstance(space, str):
        space = space_of(space, start.points, closed=start.closed, degree=start.degree)
    elif space.num_points != num_points or space.closed != start.closed:
        kinds = ["closed" if closed else "open" for closed in (start.closed, space.closed)]
        raise InputError(
            f"the start's {kinds[0]} contours have {num_points} control points, and the shape "
            f"space's {kinds[1]} ones {space.num_points}; give both the same."
        )
    likelihood = contours(
        space,
        num_targets,
        exclusion=exclusion,
        frames=frames if clutter is None else None,
        clutter=clutter,
        detector=detector,
        sigma=sigma,
        independence=independence,
        width=start.width,
        num_lines=num_lines,
    )
    if dynamics is None:
        dynamics = RandomWalk(scale=_noise(scale, space.dimension))
    model = Model(
        dynamics=dynamics,
        likelihood=likelihood,
        initial=space.project(start.points).astype(np.float32),
        parents=(-1,) * num_targets,
    )
    if exclusion != "opaque":
        return model
    if is_concrete(flip) and not 0 <= np.asarray(flip) <= 1:
        raise InputError(f"flip {flip} must be a probability, 0 to 1.")
    return model._replace(
        dynamics=WithOcclusion(dynamics, likelihood, flip),
        initial_label=np.full(2, 0.5, np.float32),
    )


def contours_tracker(
    start: Contours,
    frames: Any,
    *,
    method: str = "ps",
    num_particles: int = 500,
    resampling: str = "systematic",
    **model: Any,
) -> Partitioned:
    """A partitioned filter of contours that start at given ones.

    Args:
        start: see ``contours_model``, like the next one and ``model``.
        frames: see there.
        method: one of ``METHODS``.
        num_particles: N.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
        model: further arguments of ``contours_model``.

    Raises:
        InputError: an argument is out of range; the sentence says which.
    """
    if method not in METHODS:
        raise InputError(
            f"method {method!r} is unknown for contours; choose one of {', '.join(METHODS)}."
        )
    options = FilterOptions(method=method, particles=num_particles, resampling=resampling)
    return PARTITIONED.tracker(contours_model(start, frames, **model), options)


def outlines(tracker: Partitioned, estimates: ArrayLike) -> np.ndarray:
    """Polylines ``[..., P, M, 2]`` of estimates ``[..., P, D]``, pixels.

    Args:
        tracker: from ``contours_tracker``; its space says whether the last point joins the first.
        estimates: such as ``summary.estimate``.
    """
    return np.asarray(tracker.likelihood.outline_points(np.asarray(estimates)))


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
