"""Models of contours with given start contours (maccormick1999)."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contours.data import Contours
from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model
from jaxpf.dynamics.gaussian import RandomWalk
from jaxpf.dynamics.occlusion import WithOcclusion
from jaxpf.shapes.depth import depth_orders
from jaxpf.shapes.spaces import ShapeSpace, space_of

if TYPE_CHECKING:
    from jaxpf.contract.types import DynamicsLike, LikelihoodLike


def contours_model(
    likelihood: "LikelihoodLike",
    start: Contours,
    space: ShapeSpace | str = "similarity",
    *,
    dynamics: "DynamicsLike | None" = None,
    scale: ArrayLike | None = None,
    flip: float | None = None,
) -> Model:
    """Contours that move from given start contours.

    Opaque targets carry a label for their order in depth, and partitioned sampling is branched:
    each particle samples first the target that it believes to be nearest.

    Args:
        likelihood: of points of the space, such as ``jaxpf.likelihoods.contours``.
        start: control points just before the first frame.
        space: see ``start_space``.
        dynamics: such as ``jaxpf.dynamics.fit`` learns; default a random walk.
        scale: noise of that random walk, pixels: of the shift and of the other coordinates,
            ``[2]``, or of each coordinate, ``[D]``, or such a row for every target.  By default
            .05 and .006 of the size of each start contour (``Contours.sizes``).
        flip: of opaque targets, probability per frame that two neighbours in depth swap, see
            ``WithOcclusion``; None if targets are not opaque.
    """
    space = start_space(start, space)
    if dynamics is None:
        scale = start.usual_noise if scale is None else scale
        dynamics = RandomWalk(scale=_noise(scale, len(start.points), space.dimension))
    model = Model(
        dynamics=dynamics,
        likelihood=likelihood,
        initial=space.project(start.points).astype(np.float32),
        parents=(-1,) * len(start.points),
    )
    if flip is None:
        return model
    labels = len(depth_orders(len(start.points)))
    return model._replace(
        dynamics=WithOcclusion(dynamics, likelihood, flip),
        initial_label=np.full(labels, 1 / labels, np.float32),
    )


def start_space(start: Contours, space: ShapeSpace | str = "similarity") -> ShapeSpace:
    """Return the shape space of contours.

    Args:
        start: control points.
        space: ``"translation"``, ``"similarity"`` or ``"affine"``, relative to each start contour;
            or a space learned from key frames, which must contain the start.

    Raises:
        InputError: an unknown space, or one that does not match the contours.
    """
    if isinstance(space, str):
        return space_of(space, start.points, closed=start.closed, degree=start.degree)
    if space.num_points != start.points.shape[1] or space.closed != start.closed:
        kinds = ["closed" if closed else "open" for closed in (start.closed, space.closed)]
        raise InputError(
            f"the start's {kinds[0]} contours have {start.points.shape[1]} control points, and the "
            f"shape space's {kinds[1]} ones {space.num_points}; give both the same, as by "
            f"`jaxpf contour learn --points {start.points.shape[1]}`."
        )
    return space


def _noise(scale: ArrayLike, count: int, dimension: int) -> np.ndarray:
    """Expand and check the noise, ``[D]`` or ``[P, D]``."""
    values = np.asarray(scale, float)
    values = values.astype(np.float32)
    if values.shape[-1:] == (2,):
        values = np.repeat(values, [2, dimension - 2], axis=-1)
    fits = values.shape in ((dimension,), (count, dimension))
    if not fits or not np.isfinite(values).all() or (values < 0).any():
        raise InputError(
            f"scale {np.asarray(scale).tolist()} must be two finite numbers >= 0, of the shift and "
            f"of the shape in pixels, or one for each of the {dimension} coordinates, or such a "
            "row for every target."
        )
    return values
