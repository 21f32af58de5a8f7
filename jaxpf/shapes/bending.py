"""Bodies that bend and keep their length: worms, snakes, the middle lines of fish.

In a linear space (``jaxpf.shapes.spaces``) a line can shrink along its target at no cost, since
measurement lines across it still see its edges: it ends as a piece of the body.  Here the sides
of the control polygon have fixed lengths, and a substate tells their directions.
"""

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.shapes.spaces import check_contours
from jaxpf.shapes.splines import CUBIC

#: Coordinates that every space has: the shift, and the turn.
_RIGID = 3


@pytree_dataclass
class BendingSpace:
    """Open contours whose control polygon has sides of fixed lengths.

    The coordinates are the shift of the polygon's middle in x and y, the turn (clockwise in the
    image), and the components of its bends.  A coordinate of 1 moves the control points of a
    straight body by 1 pixel, as the root of their mean squared displacement.  One space serves all
    targets.

    Attributes:
        lengths: of the sides in pixels, ``[K - 1]``.
        bends: what one unit of the turn and of each component adds to the directions of the sides,
            radians, ``[D - 2, K - 1]``.
        degree: static, of the splines.
    """

    lengths: ArrayLike
    bends: ArrayLike
    degree: int = static_field(default=CUBIC)

    #: The contours have ends.
    closed = False
    #: One shape serves all targets.
    num_templates = 1

    @property
    def dimension(self) -> int:
        """D, the number of coordinates."""
        return np.shape(self.bends)[0] + 2

    @property
    def num_points(self) -> int:
        """K, control points of a contour."""
        return np.shape(self.bends)[1] + 1

    def control_points(self, substates):
        """Control points ``[..., P, K, 2]`` of substates ``[..., P, D]``, in pixels."""
        substates = jnp.asarray(substates)
        angles = substates[..., 2:] @ jnp.asarray(self.bends, substates.dtype)
        sides = jnp.stack([jnp.cos(angles), jnp.sin(angles)], axis=-1)
        centred = jnp.asarray(self._from_sides(), substates.dtype) @ sides
        return centred + substates[..., None, :2]

    def points_all(self, rows, partition, substates):
        """See ``jaxpf.shapes.spaces.ShapeSpace.points_all``."""
        angles = jnp.asarray(self.bends, substates.dtype).T @ substates[2:]
        sides = jnp.stack([jnp.cos(angles), jnp.sin(angles)])
        centred = (rows @ jnp.asarray(self._from_sides(), rows.dtype)) @ sides
        return centred + jnp.sum(rows, axis=1)[:, None] * substates[:2, None]

    def project(self, control: ArrayLike) -> np.ndarray:
        """Substates ``[..., P, D]`` whose sides have the directions of given control points'.

        Args:
            control: ``[..., P, K, 2]``, pixels; neighbouring sides turn by less than half a circle.
                Turns go on along the first of several leading
                axes, as those of a track ``[T, P, K, 2]`` do, and do not jump by a whole one.
        """
        control = np.asarray(control, float)
        angles = _directions(control)
        middle = angles.mean(axis=-1)
        if control.ndim > 3:
            angles = angles + (np.unwrap(middle, axis=0) - middle)[..., None]
        coordinates = angles @ np.linalg.pinv(np.asarray(self.bends, float))
        return np.concatenate([control.mean(axis=-2), coordinates], axis=-1)

    def _from_sides(self):
        """The matrix ``[K, K - 1]`` from directions of the sides to centred control points."""
        return _centred_sums(self.num_points) * jnp.asarray(self.lengths)


def bending_space(examples: ArrayLike, dimension: int, *, degree: int = CUBIC) -> BendingSpace:
    """Shift, turn, and the principal components of how examples bend, which keep their length.

    Examples count as they are, in a mirror, and from the other end, so that a straight body is the
    substate 0, and bodies bend to either side.

    Args:
        examples: control points of open contours in pixels, ``[S, K, 2]``.
        dimension: D: 2 for the shift, 1 for the turn, the rest for the components of the sides'
            directions that vary most.
        degree: of the splines.

    Raises:
        InputError: no examples, one whose neighbouring control points coincide, or a dimension
            that they do not have.
    """
    if np.size(examples) == 0:
        raise InputError("a bending space needs examples, and none was given.")
    examples = check_contours(examples, degree)
    num_sides = examples.shape[1] - 1
    if not _RIGID <= dimension <= num_sides + 2:
        raise InputError(
            f"dimension {dimension} must be {_RIGID} (a rigid body) to {num_sides + 2} (the "
            "direction of every side)."
        )
    lengths = np.linalg.norm(np.diff(examples, axis=1), axis=-1)
    if (lengths <= 0).any():
        example = int(np.argwhere(lengths <= 0)[0, 0])
        raise InputError(
            f"neighbouring control points of example {example} coincide, so that the side between "
            "them has no direction; move one."
        )
    angles = _directions(examples)
    bends = angles - angles.mean(axis=1, keepdims=True)
    bends = np.concatenate([bends, -bends, bends[:, ::-1], -bends[:, ::-1]])
    _, _, components = np.linalg.svd(bends, full_matrices=True)
    turn = np.ones((1, num_sides))
    # What few examples leave undetermined must not turn the body.
    others = np.linalg.qr(np.concatenate([turn, components]).T)[0].T[1:]
    modes = np.concatenate([turn, others[: dimension - _RIGID]])
    sides = lengths.mean(axis=0)
    # Of a straight body, whose points a small change of directions moves to the side.
    moved = modes @ (_centred_sums(num_sides + 1) * sides).T
    size = np.sqrt(np.mean(moved**2, axis=1, keepdims=True))
    return BendingSpace(as_array(sides, float), as_array(modes / size, float), degree)


def _directions(control: np.ndarray) -> np.ndarray:
    """Of the sides of polygons ``[..., K, 2]``, radians ``[..., K - 1]``, without jumps."""
    sides = np.diff(control, axis=-2)
    return np.unwrap(np.arctan2(sides[..., 1], sides[..., 0]), axis=-1)


def _centred_sums(num_points: int) -> np.ndarray:
    """The matrix ``[K, K - 1]`` from sides to the points between them, less their middle."""
    sums = np.tri(num_points, num_points - 1, -1)
    return sums - sums.mean(axis=0)
