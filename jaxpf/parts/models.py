"""Models of articulated objects: rectangles of fixed size, connected by joints.

A part is a partition with substate (x, y, theta, ...): its centre in pixels and its angle in
radians, clockwise in the image (gonzales2011, section 4).
"""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.model import Model, check_tree
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.dynamics.gaussian import RandomWalk
from jaxpf.dynamics.joints import (
    RelativeToParent,
    UniformAround,
    UniformJoints,
    joints_between,
    substates_at,
)
from jaxpf.likelihoods.wrapped import WrappedLikelihood

DYNAMICS = ("relative", "absolute")

#: Noise of x, y (pixels) and theta (radians) per frame, for roots and absolute parts.
DEFAULT_SCALE = (3.0, 3.0, 0.06)
#: Noise of a joint's offset (pixels) and angle (radians) per frame.
DEFAULT_JOINT_SCALE = (0.5, 0.5, 0.08)


@pytree_dataclass
class OfFixedSize(WrappedLikelihood):
    """Evaluates a likelihood of (u, v, scale, theta) at (x, y, 1, theta) of a part's substate.

    Attributes:
        likelihood: such as ``jaxpf.likelihoods.histogram(..., method="sampled")``.
    """

    likelihood: Any

    def translated(self, substates):
        """Convert substates ``[D, ...]`` to (u, v, scale, theta), ``[4, ...]``."""
        x, y, theta = substates[:3]
        return jnp.stack([x, y, jnp.ones_like(x), theta])


def parts_model(
    likelihood: Any,
    poses: ArrayLike,
    sizes: ArrayLike,
    parents: Sequence[int],
    *,
    dynamics: str = "relative",
    scale: ArrayLike = DEFAULT_SCALE,
    joint_scale: ArrayLike = DEFAULT_JOINT_SCALE,
    anchors: tuple[ArrayLike, ArrayLike] | None = None,
    reach: ArrayLike = 0.0,
) -> Model:
    """One or several articulated objects that start at given poses.

    Args:
        likelihood: of substates (u, v, scale, theta), such as
            ``jaxpf.likelihoods.histogram_from_patches(..., method="sampled")``.
        poses: x, y (pixels) and theta (radians), ``[P, 3]``, just before the first frame.
        sizes: width and height of the parts, pixels, ``[P, 2]``.
        parents: the part tree, -1 for a root.
        dynamics: ``"relative"``, parts follow their parents (``jaxpf.dynamics``); ``"absolute"``,
            every part follows its own random walk, as in gonzales2011.
        scale: noise of x, y and theta per frame, ``[3]`` or ``[P, 3]``: of roots, and with
            absolute dynamics of all parts.
        joint_scale: noise of a joint's offset (x, y) and angle, ``[3]`` or ``[P, 3]``.
        anchors: each part's joint in its parent's coordinates and in its own, ``[P, 2]`` each;
            by default ``jaxpf.dynamics.joints_between``.
        reach: half-width of the uniform start distribution around the poses, in x, y (pixels) and
            theta (or, with relative dynamics, in the joint's offset and angle); ``[]``, ``[3]``
            or ``[P, 3]``.  0 starts all particles at the poses.
    """
    tree = check_tree(parents)
    poses, sizes = check_parts(poses, sizes, tree)
    check_known("dynamics ", dynamics, DYNAMICS)
    scale = _noise("scale", scale, len(tree))
    reach = np.broadcast_to(_noise("reach", reach, len(tree)), (len(tree), 3))
    moves: Any
    initial: Any
    if dynamics == "absolute":
        moves = RandomWalk(scale=scale)
        initial = UniformAround(poses, reach) if reach.any() else poses
    else:
        parent_anchor, part_anchor = anchors or joints_between(poses, sizes, tree)
        moves = RelativeToParent(
            scale=scale,
            joint_scale=_noise("joint_scale", joint_scale, len(tree)),
            parent_anchor=np.asarray(parent_anchor, np.float32),
            part_anchor=np.asarray(part_anchor, np.float32),
            parents=tree,
        )
        initial = UniformJoints(moves, poses, reach) if reach.any() else substates_at(moves, poses)
    return Model(moves, OfFixedSize(likelihood), initial, tree)


def cut_pictures(frame: Any, poses: ArrayLike, sizes: ArrayLike) -> list[np.ndarray]:
    """Cut upright pictures out of rectangles at any angle, for learning likelihoods.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        poses: x, y (pixels) and theta (radians), ``[P, 3]``.
        sizes: width and height, pixels, ``[P, 2]``; rounded, and at least 1.

    Returns:
        P pictures, uint8 RGB ``[h, w, 3]``, sampled from the nearest pixels of the frame.
    """
    frame = np.asarray(frame)
    pictures = []
    for (x, y, theta), size in zip(np.asarray(poses), np.asarray(sizes), strict=True):
        width, height = np.maximum(np.rint(size).astype(int), 1)
        across = ((np.arange(width) + 0.5) / width - 0.5) * size[0]
        down = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * size[1]
        column = np.floor(x + np.cos(theta) * across - np.sin(theta) * down)
        row = np.floor(y + np.sin(theta) * across + np.cos(theta) * down)
        column = column.clip(0, frame.shape[1] - 1).astype(int)
        pictures.append(frame[row.clip(0, frame.shape[0] - 1).astype(int), column])
    return pictures


def check_parts(
    poses: ArrayLike, sizes: ArrayLike, tree: Sequence[int], names: Sequence[str] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Check poses ``[P, 3]`` and sizes ``[P, 2]`` and convert them to float32.

    Args:
        poses: x, y, theta.
        sizes: width and height, pixels.
        tree: the part tree.
        names: of the parts, for messages; by default their numbers.

    Raises:
        InputError: a wrong shape, a non-finite pose, or a part without area.
    """
    poses, sizes = np.asarray(poses, np.float32), np.asarray(sizes, np.float32)
    for name, array, wanted in (("poses", poses, 3), ("sizes", sizes, 2)):
        if array.shape != (len(tree), wanted):
            raise InputError(
                f"{name} has shape {list(array.shape)}; give [{len(tree)}, {wanted}], one row for "
                "every part of the tree."
            )
    for part, (pose, (width, height)) in enumerate(zip(poses, sizes, strict=True)):
        label = str(part) if names is None else repr(names[part])
        if not np.isfinite(pose).all():
            raise InputError(f"the pose of part {label} is {pose.tolist()}; give finite numbers.")
        if not (width > 0 and height > 0 and np.isfinite(width * height)):
            raise InputError(
                f"part {label} measures {width:g} x {height:g} pixels, which is no area; give a "
                "positive width and height."
            )
    return poses, sizes


def _noise(name: str, values: ArrayLike, num_parts: int) -> np.ndarray:
    """Check standard deviations or ranges and keep their shape."""
    values = np.asarray(values, np.float32)
    fits = values.shape in ((), (3,), (num_parts, 3))
    if not fits or not np.isfinite(values).all() or (values < 0).any():
        raise InputError(
            f"{name} {values.tolist()} must be three finite numbers >= 0, of x and y in pixels "
            "and of the angle in radians, such as 3,3,0.06, or such a row for every part."
        )
    return values
