"""Bodies that bend and keep their length: the shape space of worms, snakes and fish.

A worm's middle line is told by the angle of its tangent along it, and few components of that
angle tell nearly all of it ("eigenworms": Stephens, Johnson-Kerner, Bialek and Ryu, 2008, PLoS
Computational Biology 4:e1000028).  In a linear space of control points, ``ShapeSpace``, a contour
between two examples is shorter than both, and nothing but the picture holds its length: where two
bodies cross, contours shrink along them.  Here the length is a constant.

A substate is ``(x, y, turn, bends)``: the middle, the mean angle, and the components.  As in
``ShapeSpace``, 1 of each moves the points of a straight body by 1 pixel, root mean square.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import of_partition
from jaxpf.errors import InputError
from jaxpf.models.splines import CUBIC, basis, check_order, even_places, resampled
from jaxpf.pytree import as_array, pytree_dataclass, static_field

#: Straight pieces of which a body is made.
PIECES = 32


@pytree_dataclass
class BendingSpace:
    """What open contours of fixed length a substate can stand for.

    Attributes:
        length: of each target, or of all, pixels, ``[P]`` or ``[1]``.
        turn: ``[]``, radians by which 1 of the coordinate turns the body.
        modes: ``[B, PIECES]``, radians that 1 of each bend adds to the angle of each piece; their
            means over the pieces are 0.
        num_points: static, K, control points of the splines that stand for a body in files.
        degree: static, of these splines.
    """

    length: ArrayLike
    turn: ArrayLike
    modes: ArrayLike
    num_points: int = static_field(default=8)
    degree: int = static_field(default=CUBIC)

    #: Such bodies have two ends.
    closed = False

    @property
    def dimension(self) -> int:
        """D, the number of coordinates."""
        return 3 + np.shape(self.modes)[0]

    @property
    def num_templates(self) -> int:
        """For how many targets there are lengths; 1 where they have one in common."""
        return np.shape(self.length)[0]

    def along(self, partition, substates, places: np.ndarray):
        """Points of each particle's body, and the body's direction there.

        Args:
            partition: target of each particle, ``[N]`` or ``[]``.
            substates: ``[D, N]``.
            places: ``[M]``, how far along the body, 0 to 1.

        Returns:
            x, y (pixels) and their derivatives with respect to the place, ``[M, N]`` each.
        """
        length = of_partition(jnp.asarray(self.length, substates.dtype), partition)
        return self._traced(substates, length, places)

    def points(self, substates, places: np.ndarray):
        """Points ``[..., P, M, 2]`` at places ``[M]`` of substates ``[..., P, D]``, pixels."""
        substates = jnp.asarray(substates)
        length = jnp.broadcast_to(jnp.asarray(self.length, substates.dtype), (substates.shape[-2],))
        flat = substates.reshape(-1, *substates.shape[-2:])
        x, y, _, _ = self._traced(
            jnp.moveaxis(flat, -1, 0).reshape(self.dimension, -1),
            jnp.tile(length, flat.shape[0]),
            places,
        )
        return jnp.moveaxis(jnp.stack([x, y]), (0, 1), (-1, -2)).reshape(
            *substates.shape[:-1], len(places), 2
        )

    def control_points(self, substates):
        """Control points ``[..., P, K, 2]`` of the splines nearest to substates ``[..., P, D]``."""
        places = even_places(4 * self.num_points, closed=False)
        matrix = basis(places, self.num_points, closed=False, degree=self.degree)
        points = self.points(substates, places)
        return jnp.asarray(np.linalg.pinv(matrix), points.dtype) @ points

    def project(self, control: ArrayLike) -> np.ndarray:
        """The substates ``[..., P, D]`` whose bodies bend and lie as given contours do.

        Angles go on from one contour to the next along the first axis, so that of tracks
        ``[T, P, K, 2]`` none makes a whole turn between frames.

        Args:
            control: ``[..., P, K, 2]``, pixels.
        """
        control = np.asarray(control, float)
        flat = control.reshape(-1, *control.shape[-2:])
        places = even_places(8 * self.num_points, closed=False)
        matrix = basis(places, control.shape[-2], closed=False, degree=self.degree)
        lines = [matrix @ points for points in flat]
        angles, middles = angles_of(lines)
        turn, modes = np.asarray(self.turn, float), np.asarray(self.modes, float)
        mean = angles.mean(axis=1)
        bends = (angles - mean[:, None]) @ np.linalg.pinv(modes)
        mean = mean.reshape(control.shape[:-2])
        if mean.ndim > 1:
            mean = np.unwrap(mean, axis=0)
        found = np.concatenate([middles, mean.reshape(-1, 1) / turn, bends], axis=1)
        return found.reshape(*control.shape[:-2], self.dimension)

    def _traced(self, substates, length, places):
        """See ``along``; the length is ``[]`` or ``[N]``."""
        dtype = substates.dtype
        modes = jnp.asarray(self.modes, dtype)
        angle = jnp.asarray(self.turn, dtype) * substates[2] + modes.T @ substates[3:]
        reached, direction = (jnp.asarray(matrix, dtype) for matrix in _tracing(places))
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        return (
            substates[0] + length * (reached @ cosine),
            substates[1] + length * (reached @ sine),
            length * (direction @ cosine),
            length * (direction @ sine),
        )


def bending_space(
    centrelines: Sequence[ArrayLike] | np.ndarray, dimension: int, *, num_points: int = 8
) -> BendingSpace:
    """The space of bodies that bend as examples do, to either side and from either end.

    Args:
        centrelines: polylines ``[S, 2]`` from end to end, pixels.
        dimension: D: 3 for place and angle, the rest for the components that vary most.
        num_points: K, see ``BendingSpace``.

    Raises:
        InputError: no examples, or too few for the dimension.
    """
    check_order(num_points)
    if len(centrelines) == 0:
        raise InputError("a shape space of key frames needs key frames, and none was given.")
    if not 3 <= dimension <= PIECES:
        raise InputError(
            f"dimension {dimension} must be 3 (place and angle alone) to {PIECES} for bodies that "
            "bend."
        )
    if len(centrelines) < dimension:
        raise InputError(
            f"{len(centrelines)} key frame(s) are fewer than the {dimension} dimensions asked for; "
            "give more key frames or a lower dimension."
        )
    angles, _ = angles_of(centrelines)
    bends = angles - angles.mean(axis=1, keepdims=True)
    # From the other end the same angles come in the other order; in a mirror they change sign.
    every = np.concatenate([bends, bends[:, ::-1]])
    every = np.concatenate([every, -every])
    _, _, components = np.linalg.svd(every)
    length = float(np.mean([_length(line) for line in centrelines]))
    modes = components[: dimension - 3]
    reached, _ = _tracing(even_places(PIECES + 1, closed=False))
    moved = length * np.sqrt(np.mean((modes @ reached.T) ** 2, axis=1, keepdims=True))
    turned = length * np.sqrt(np.mean((reached @ np.ones(PIECES)) ** 2))
    return BendingSpace(
        length=as_array([length], float),
        turn=as_array(1 / turned, float),
        modes=as_array(modes / moved, float),
        num_points=num_points,
    )


def angles_of(lines: Sequence[ArrayLike] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles ``[S, PIECES]`` of polylines' equal pieces, radians, and their middles ``[S, 2]``."""
    nodes = np.stack([resampled(line, PIECES + 1, closed=False) for line in lines])
    steps = np.diff(nodes, axis=1)
    return np.unwrap(np.arctan2(steps[..., 1], steps[..., 0]), axis=1), nodes.mean(axis=1)


def _length(line: ArrayLike) -> float:
    return float(np.linalg.norm(np.diff(np.asarray(line, float), axis=0), axis=1).sum())


def _tracing(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From the pieces' directions to points about the middle, and to directions, at places.

    Both ``[M, PIECES]``, for a body of length 1.
    """
    nodes = np.tri(PIECES + 1, PIECES, -1) / PIECES
    nodes = nodes - nodes.mean(axis=0)
    at = np.clip(np.asarray(places, float), 0, 1) * PIECES
    piece = np.minimum(at.astype(int), PIECES - 1)
    share = (at - piece)[:, None]
    reached = (1 - share) * nodes[piece] + share * nodes[piece + 1]
    centres = np.clip(at - 0.5, 0, PIECES - 1)
    first = np.minimum(centres.astype(int), PIECES - 2)
    share = (centres - first)[:, None]
    one = np.eye(PIECES)
    return reached, (1 - share) * one[first] + share * one[first + 1]
