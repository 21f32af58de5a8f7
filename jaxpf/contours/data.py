"""What is known of contours before they are tracked: where they start, what was marked or learned.

``jaxpf.files`` reads and writes these.
"""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.shapes.splines import CUBIC

if TYPE_CHECKING:
    from jaxpf.dynamics.gaussian import LinearGaussian
    from jaxpf.shapes.spaces import ShapeSpace

#: Noise of every coordinate per frame, pixels: the shift's, and that of the shape.
DEFAULT_SCALE = (3.0, 1.0)
#: Arrays of learned dynamics.
MATRICES = ("transition", "lag", "offset", "noise")


@dataclasses.dataclass(frozen=True, eq=False)
class Contours:
    """Contours to start from, cubic B-splines by default.

    Attributes:
        names: of the P targets.
        points: float64 ``[P, K, 2]``, control points in pixels.
        closed: whether they have no ends.
        degree: of the splines.
        width: of a wire with two edges, pixels; None for a contour that is one edge.
        remarks: sentences on what was accepted but may be a mistake.
    """

    names: tuple[str, ...]
    points: np.ndarray
    closed: bool = True
    degree: int = CUBIC
    width: float | None = None
    remarks: tuple[str, ...] = ()


class Annotated(NamedTuple):
    """Contours by frame and target.

    Attributes:
        kind: of ``jaxpf.contract.names.ANNOTATIONS``.
        lines: (frame from 0, target) -> points ``[S, 2]``, or of masks a picture ``[H, W]`` that
            is not 0 on the target.
    """

    kind: str
    lines: dict[tuple[int, str], np.ndarray]


class Learned(NamedTuple):
    """What was learned of one target, or of several like ones together.

    Attributes:
        space: with one template.
        dynamics: of one target, or None.
    """

    space: "ShapeSpace"
    dynamics: "LinearGaussian | None"

    def dynamics_of(self, num_targets: int) -> "LinearGaussian | None":
        """The same dynamics for each of a number of targets."""
        from jaxpf.dynamics.gaussian import LinearGaussian

        if self.dynamics is None:
            return None
        repeated: dict[str, Any] = {
            name: None if values is None else np.repeat(np.asarray(values)[:1], num_targets, axis=0)
            for name in MATRICES
            for values in [getattr(self.dynamics, name)]
        }
        return LinearGaussian(**repeated)
