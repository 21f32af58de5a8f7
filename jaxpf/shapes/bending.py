"""Bodies that bend and keep their length: worms, snakes, the midlines of fish.

In a linear space (``jaxpf.shapes.spaces``) a line can shrink along its target at no cost, since
its measurement lines still see the target's edges, and ends up covering a piece of the body.
Here the sides of the control polygon have fixed lengths, and a substate holds their directions.
"""

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_array, check_whole, numbers_in
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.shapes.spaces import check_contours
from jaxpf.shapes.splines import CUBIC

#: Number of coordinates that every space has: shift in x and y, and rotation.
_RIGID = 3


@pytree_dataclass
class BendingSpace:
    """Open contours whose control polygon has sides of fixed lengths.

    The coordinates are the shift of the polygon's mean point in x and y, the rotation (clockwise
    in the image), and the components of its bends.  A coordinate of 1 moves the control points of
    a straight body by 1 pixel (root mean square).  All targets share one space.

    Attributes:
        lengths: of the sides in pixels, ``[K - 1]``.
        bends: change of the sides' directions per unit of the rotation and of each component,
            radians, ``[D - 2, K - 1]``.
        degree: static, of the splines.
    """

    lengths: ArrayLike
    bends: ArrayLike
    degree: int = static_field(default=CUBIC)

    #: The contours are open.
    closed = False
    #: All targets share one shape.
    num_templates = 1

    @property
    def dimension(self) -> int:
        """D, the number of coordinates."""
        return np.shape(self.bends)[0] + 2

    @property
    def num_points(self) -> int:
        """K, number of control points of a contour."""
        return np.shape(self.bends)[1] + 1

    def control_points(self, substates):
        """Control points ``[..., P, K, 2]`` of substates ``[..., P, D]``, in pixels."""
        check_array("substates", substates, f"coordinates, [..., P, {self.dimension}]")
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
        """Substates ``[..., P, D]`` whose sides best match the directions of given control points.

        Args:
            control: ``[..., P, K, 2]``, pixels; neighbouring sides turn by less than half a circle.
                With leading axes, as in a track ``[T, P, K, 2]``, angles are unwrapped along the
                first, so rotations do not jump by a full turn.
        """
        control = numbers_in("control", control, f"x, y, [..., P, {self.num_points}, 2]")
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
    """Learn a bending space: shift, rotation, and principal components of the examples' bends.

    Every example counts four times: as given, mirrored, and each of these from the other end.  So
    the substate 0 is a straight body, and bodies bend to either side.

    Args:
        examples: control points of open contours in pixels, ``[S, K, 2]``.
        dimension: D: 2 for the shift, 1 for the rotation, the rest for the components of the
            sides' directions that vary most.
        degree: of the splines.

    Raises:
        InputError: there are no examples, neighbouring control points coincide, or the dimension
            is out of range.
    """
    examples = check_contours(examples, degree)
    num_sides = examples.shape[1] - 1
    check_whole("dimension", dimension, _RIGID, num_sides + 2)  # the direction of every side
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
    # Directions that few examples leave undetermined must not rotate the body.
    others = np.linalg.qr(np.concatenate([turn, components]).T)[0].T[1:]
    modes = np.concatenate([turn, others[: dimension - _RIGID]])
    sides = lengths.mean(axis=0)
    # For a straight body: a small change of directions moves its points sideways.
    moved = modes @ (_centred_sums(num_sides + 1) * sides).T
    size = np.sqrt(np.mean(moved**2, axis=1, keepdims=True))
    return BendingSpace(as_array(sides, float), as_array(modes / size, float), degree)


def _directions(control: np.ndarray) -> np.ndarray:
    """Directions of the sides of polygons ``[..., K, 2]``, unwrapped, radians ``[..., K - 1]``."""
    sides = np.diff(control, axis=-2)
    return np.unwrap(np.arctan2(sides[..., 1], sides[..., 0]), axis=-1)


def _centred_sums(num_points: int) -> np.ndarray:
    """The matrix ``[K, K - 1]`` from sides to control points, minus their mean."""
    sums = np.tri(num_points, num_points - 1, -1)
    return sums - sums.mean(axis=0)
