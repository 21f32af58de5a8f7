"""Shape spaces: a substate of a few numbers describes a whole contour.

Every space here is linear, ``control = template + sum_d x_d mode_d`` (Blake and Isard, Active
Contours, 1998, chapter 4): translations; Euclidean similarities and affine maps, which act on the
template linearly; and the principal components of key frames.  The substate 0 is the template.

Modes are scaled so that a coordinate of 1 moves the control points by 1 pixel (root mean square).
So every coordinate, its noise and its spread are in pixels.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.lowering.programs import in_full
from jaxpf.shapes.splines import CUBIC, check_order

#: Shape spaces that need no training examples.
SHAPE_SPACES = ("translation", "similarity", "affine")


@pytree_dataclass
class ShapeSpace:
    """A linear space of contours.

    Attributes:
        template: control points of the substate 0 in pixels, ``[P, K, 2]``, or ``[1, K, 2]`` if
            all targets share one.
        modes: change of the control points per unit of each coordinate, ``[P, D, K, 2]`` or
            ``[1, D, K, 2]``.
        closed: static, whether the contours are closed.
        degree: static, of the splines.
    """

    template: ArrayLike
    modes: ArrayLike
    closed: bool = static_field(default=True)
    degree: int = static_field(default=CUBIC)

    @property
    def dimension(self) -> int:
        """D, the number of coordinates."""
        return self.modes.shape[1]  # type: ignore[union-attr]

    @property
    def num_points(self) -> int:
        """K, number of control points of a contour."""
        return np.shape(self.template)[1]

    @in_full
    def control_points(self, substates):
        """Control points ``[..., P, K, 2]`` of substates ``[..., P, D]``, in pixels."""
        substates = jnp.asarray(substates)
        template = jnp.asarray(self.template, substates.dtype)
        modes = jnp.asarray(self.modes, substates.dtype)
        modes = jnp.broadcast_to(modes, (substates.shape[-2], *modes.shape[1:]))
        return template + jnp.einsum("...pd,pdkc->...pkc", substates, modes)

    @in_full
    def points_all(self, rows, partition, substates):
        """Weighted means ``[2, R, N]`` of the control points of all particles, x before y.

        Args:
            rows: the weights, ``[R, K]``, such as a spline's basis.
            partition: the target of each particle, ``[N]``.
            substates: ``[D, N]``.
        """
        template = jnp.asarray(self.template, substates.dtype)
        modes = jnp.asarray(self.modes, substates.dtype)
        num_targets, dimension, num_points = modes.shape[:3]

        def matrix(control):
            """From control points ``[n, K, 2]`` to the matrix ``[2 R, n]`` of their x, then y."""
            return jnp.einsum("mk,rkc->cmr", rows, control).reshape(-1, control.shape[0])

        if num_targets == 1:
            start, moved = matrix(template), matrix(modes[0]) @ substates
        else:
            # One product of all targets' matrices; other targets' coordinates are set to zero.
            is_target = (jnp.arange(num_targets)[:, None] == partition).astype(substates.dtype)
            start = matrix(template) @ is_target
            placed = (is_target[:, None] * substates[None]).reshape(-1, substates.shape[1])
            moved = matrix(modes.reshape(num_targets * dimension, num_points, 2)) @ placed
        return (start + moved).reshape(2, rows.shape[0], -1)

    def project(self, control: ArrayLike) -> np.ndarray:
        """The substates ``[..., P, D]`` whose contours are nearest to given control points.

        Args:
            control: ``[..., P, K, 2]``, pixels.
        """
        control = np.asarray(control, float)
        template, modes = np.asarray(self.template, float), np.asarray(self.modes, float)
        num_targets, length = control.shape[-3], control.shape[-2] * 2
        rest = (control - template).reshape(*control.shape[:-2], length)
        inverse = np.linalg.pinv(modes.reshape(len(modes), self.dimension, length))
        inverse = np.broadcast_to(inverse, (num_targets, *inverse.shape[1:]))
        return np.einsum("...pl,pld->...pd", rest, inverse)


def space_of(
    name: str, contours: ArrayLike, *, closed: bool = True, degree: int = CUBIC
) -> ShapeSpace:
    """Translations, similarities or affine maps of given contours.

    Args:
        name: one of ``SHAPE_SPACES``; they have 2, 4 and 6 dimensions.  The first coordinates are
            the shifts in x and y.  The others act about the mean of the control points: growth and
            rotation (clockwise in the image, to first order) for a similarity; for an affine map
            the four matrix entries x to x, y to x, x to y and y to y.
        contours: control points in pixels, ``[P, K, 2]``, the substate 0 of each target.
        closed: whether the contours are closed.
        degree: of the splines.

    Raises:
        InputError: the name is unknown, or the contours are invalid.
    """
    check_known("shape space ", name, SHAPE_SPACES)
    contours = check_contours(contours, degree)
    return _scaled(contours, [_linear_modes(name, contour) for contour in contours], closed, degree)


def key_frame_space(examples: ArrayLike, dimension: int, *, closed: bool = True) -> ShapeSpace:
    """Shifts, and the principal components of centred examples.

    maccormick1999, section 4: "key-frames from principal components analysis of templates".
    All targets share one space; ``project`` gives each target's start.

    Args:
        examples: control points in pixels, ``[S, K, 2]``, in correspondence.
        dimension: D: 2 for the shift, the rest for the components that vary most.
        closed: whether the contours, cubic splines, are closed.

    Raises:
        InputError: there are no key frames, or too few for the dimension.
    """
    examples = check_contours(examples)
    length = examples.shape[1] * 2
    check_whole("dimension", dimension, 2, length)  # shifts alone; every control point
    if len(examples) < dimension:
        raise InputError(
            f"{len(examples)} key frame(s) are fewer than the {dimension} dimensions asked for; "
            "give more key frames or a lower dimension."
        )
    centred = examples - examples.mean(axis=1, keepdims=True)
    mean = centred.mean(axis=0)
    _, _, components = np.linalg.svd((centred - mean).reshape(len(examples), length))
    shifts = _linear_modes("translation", mean)
    modes = np.concatenate([shifts, components[: dimension - 2].reshape(-1, *mean.shape)])
    return _scaled(mean[None], [modes], closed, CUBIC)


def check_contours(contours: ArrayLike, degree: int = CUBIC) -> np.ndarray:
    """Valid control points ``[P, K, 2]`` in float64.

    Raises:
        InputError: the shape is wrong, a number is not finite, or there are too few points.
    """
    contours = np.asarray(contours, float)
    check_order(contours.shape[1], degree)
    if not np.isfinite(contours).all():
        target = int(np.argwhere(~np.isfinite(contours))[0, 0])
        raise InputError(f"contour {target} has a control point that is not finite; check it.")
    return contours


def _linear_modes(name: str, contour: np.ndarray) -> np.ndarray:
    """Unscaled modes ``[D, K, 2]`` of a linear space about a contour ``[K, 2]``."""
    x, y = (contour - contour.mean(axis=0)).T
    none, ones = np.zeros_like(x), np.ones_like(x)
    modes = [(ones, none), (none, ones)]
    if name == "similarity":
        modes += [(x, y), (-y, x)]
    elif name == "affine":
        modes += [(x, none), (y, none), (none, x), (none, y)]
    return np.array(modes).transpose(0, 2, 1)


def _scaled(
    template: np.ndarray, modes: Sequence[np.ndarray], closed: bool, degree: int
) -> ShapeSpace:
    """The space with every mode scaled to one pixel, root mean square."""
    every = np.stack(modes)
    size = np.sqrt(np.mean(np.sum(every**2, axis=-1), axis=-1, keepdims=True))[..., None]
    if np.any(size < 1e-9):
        target, mode = np.argwhere(size < 1e-9)[0, :2]
        raise InputError(
            f"contour {target} has no extent along coordinate {mode} of its shape space; give it "
            "control points that do not all lie on one line, or a smaller space."
        )
    return ShapeSpace(as_array(template, float), as_array(every / size, float), closed, degree)
