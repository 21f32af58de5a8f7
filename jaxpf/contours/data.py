"""Data of contours: start contours, annotations and learned models.

``jaxpf.contours.files``, ``jaxpf.contours.annotated_files`` and ``jaxpf.contours.learned_files``
read and write them.
"""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
from jaxpf.shapes.splines import CUBIC, check_order

if TYPE_CHECKING:
    from jaxpf.dynamics.gaussian import LinearGaussian
    from jaxpf.shapes.spaces import ShapeSpace

#: Noise per frame of the shift and of the other coordinates, as a share of a contour's size.
_NOISE = 0.05, 0.006
#: Arrays of learned dynamics.
MATRICES = ("transition", "lag", "offset", "noise")


@dataclasses.dataclass(frozen=True, eq=False)
class Contours:
    """Start contours, cubic B-splines by default.

    Attributes:
        names: of the P targets.
        points: float64 ``[P, K, 2]``, control points in pixels.
        closed: whether they are closed curves.
        degree: of the splines.
        width: of a wire with two edges, pixels; None for a contour that is a single edge.
        remarks: warnings about accepted but possibly wrong input.
    """

    names: tuple[str, ...]
    points: np.ndarray
    closed: bool = True
    degree: int = CUBIC
    width: float | None = None
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        points = np.asarray(self.points, float)
        check_order(points.shape[1], self.degree)
        if not np.isfinite(points).all():
            raise InputError("points hold a number that is not finite; give pixels, [P, K, 2].")
        if self.width is not None:
            check_number("width", self.width, above=0)
            if self.closed:
                raise InputError(
                    f"width {self.width:g} works only with open contours; leave it out."
                )
        object.__setattr__(self, "points", points)

    @property
    def sizes(self) -> np.ndarray:
        """Sizes ``[P]`` in pixels: sides of squares whose diagonal is that of a bounding box.

        It is the box of a contour's control points, which holds the contour.
        """
        return np.linalg.norm(np.ptp(self.points, axis=1), axis=-1) / np.sqrt(2)

    @property
    def usual_noise(self) -> np.ndarray:
        """Default noise ``[P, 2]`` per frame, of the shift and of other coordinates, pixels."""
        return self.sizes[:, None] * _NOISE


class Annotated(NamedTuple):
    """Annotated contours by frame and target.

    Attributes:
        kind: masks, outlines or centrelines.
        lines: (frame from 0, target) -> points ``[S, 2]``, or for masks a picture ``[H, W]`` that
            is nonzero on the target.
    """

    kind: str
    lines: dict[tuple[int, str], np.ndarray]


class Learned(NamedTuple):
    """A model learned from one target, or from several targets of one kind.

    Attributes:
        space: with one template.
        dynamics: of one target, or None.
    """

    space: "ShapeSpace"
    dynamics: "LinearGaussian | None"

    def dynamics_of(self, num_targets: int) -> "LinearGaussian | None":
        """Repeat the dynamics for every target."""
        from jaxpf.dynamics.gaussian import LinearGaussian

        if self.dynamics is None:
            return None
        repeated: dict[str, Any] = {
            name: None if values is None else np.repeat(np.asarray(values)[:1], num_targets, axis=0)
            for name in MATRICES
            for values in [getattr(self.dynamics, name)]
        }
        return LinearGaussian(**repeated)
