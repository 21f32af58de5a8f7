"""Dynamics of parts attached to their parents by joints.

The pose of a part is (x, y, theta): its centre in pixels and its angle in radians, clockwise in
the image.  A *joint* is a point fixed in the part's coordinates (``part_anchor``) that coincides,
up to an offset, with a point of its parent (``parent_anchor``).  The coordinates of a part have
their origin at its rectangle's centre and rotate with it.  With R(theta) the rotation and q the
parent::

    theta = theta_q + angle
    (x, y) = (x_q, y_q) + R(theta_q) (parent_anchor + offset) - R(theta) part_anchor
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import DynamicsWithDensity
from jaxpf.contract.model import check_tree
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.dynamics.gaussian import log_normal
from jaxpf.lowering.columns import ready_to_mix
from jaxpf.shapes.rectangles import rotate


@pytree_dataclass
class RelativeToParent(DynamicsWithDensity):
    """Joints follow random walks, and parts follow their parents.

    A substate is (x, y, theta, offset_x, offset_y, angle): the absolute pose in the image, and
    the joint that produced it; a root's joint is zero.  Every frame::

        root:   pose = pose + scale n
        part:   offset = memory offset + scale n,   angle = angle + scale n,

    and a part's pose follows from its parent's new pose, so the tree couples the parts.

    Attributes:
        scale: ``[P, 3]`` or ``[3]``, standard deviations of the noise per frame: of (x, y, theta)
            for a root, of (offset_x, offset_y, angle) for a part; pixels, pixels and radians.
        parent_anchor: ``[P, 2]``, the joint in the parent's coordinates, pixels.
        part_anchor: ``[P, 2]``, the joint in the part's own coordinates, pixels.
        joint_scale: ``[P, 3]`` or ``[3]``, replaces ``scale`` for non-root parts; None uses
            ``scale`` for all.
        memory: factor applied to the offset each frame; below 1 offsets decay to zero, so parts
            cannot drift away from their parents.
        walks_alone: ``[P]`` bool, the parts that move like roots; by default the roots.  If all
            do, the dynamics are absolute; changing it needs no recompilation.
        parents: static, the part tree, -1 for a root.
    """

    scale: ArrayLike
    parent_anchor: ArrayLike
    part_anchor: ArrayLike
    memory: ArrayLike = 0.5
    walks_alone: Any = None
    joint_scale: Any = None
    parents: tuple[int, ...] = static_field(default=(-1,))

    def __post_init__(self):
        object.__setattr__(self, "parents", check_tree(self.parents))
        for name in ("scale", "joint_scale", "memory"):
            if getattr(self, name) is not None or name != "joint_scale":
                check_number(name, getattr(self, name), least=0)
        for name in ("parent_anchor", "part_anchor"):
            check_number(name, getattr(self, name))

    def propagate_all(self, key, partition, current, previous, parent):
        """Move all particles, ``[6, N]``."""
        scale, parent_anchor, part_anchor, alone = self._known(partition, current.dtype)
        noise = jax.random.normal(key, scale.shape, current.dtype)
        noise = scale * ready_to_mix(noise)
        joint = self._expected_joint(current) + noise
        pose = place(joint, parent, parent_anchor, part_anchor)
        pose = jnp.where(alone, current[:3] + noise, pose)
        return jnp.concatenate([pose, jnp.where(alone, 0.0, joint)])

    def log_density_all(self, partition, new, current, previous, parent):
        """Log-densities of all particles, ``[N]``, in joint coordinates.

        A part's density is that of (offset_x, offset_y, angle).  Its pose is assumed to
        be consistent with them and its parent, so the anchors have no derivative here.
        """
        scale, _, _, alone = self._known(partition, current.dtype)
        moved = jnp.where(alone, new[:3] - current[:3], new[3:] - self._expected_joint(current))
        return log_normal(moved, scale)

    def _expected_joint(self, current):
        """Noise-free joint of a part, ``[3, N]``."""
        memory = jnp.asarray(self.memory, current.dtype)
        return jnp.stack([memory * current[3], memory * current[4], current[5]])

    def _known(self, partition, dtype):
        """Scale ``[3, N]``, both anchors ``[2, N]`` and ``walks_alone`` of each particle's part.

        One gather for all, since the cost of a gather hardly depends on its width.
        """
        constants = [jnp.asarray(x, dtype) for x in (self.parent_anchor, self.part_anchor)]
        constants = [self._scale_by_part(dtype), *constants]
        alone = np.array(self.parents) < 0 if self.walks_alone is None else self.walks_alone
        constants.append(jnp.asarray(alone, dtype)[:, None])
        of_part = jnp.concatenate(constants, axis=1)[partition].T
        return of_part[:3], of_part[3:5], of_part[5:7], of_part[7] > 0

    def _scale_by_part(self, dtype):
        """The noise scale of each part, ``[P, 3]``."""
        shape = (len(self.parents), 3)
        scale = jnp.broadcast_to(jnp.asarray(self.scale, dtype), shape)
        if self.joint_scale is None:
            return scale
        joint_scale = jnp.broadcast_to(jnp.asarray(self.joint_scale, dtype), shape)
        return jnp.where(np.array(self.parents)[:, None] < 0, scale, joint_scale)


@pytree_dataclass
class UniformAround:
    """Initial sampler: each part uniform around its start pose, ``key -> [P, D]``.

    Source: gonzales2011, section 4, "particles are uniformly generated around the object".

    Attributes:
        poses: ``[P, 3]``, (x, y, theta) of the parts at the start.
        reach: largest deviation per coordinate, ``[3]`` or ``[P, 3]``; pixels, pixels and
            radians.
        dynamics: if given, roots and joints deviate, and parts follow their parents: D is 6.
    """

    poses: ArrayLike
    reach: ArrayLike
    dynamics: RelativeToParent | None = None

    #: Trees are drawn independently, so roots may be exchanged (``sps``).
    independent = True

    def __post_init__(self):
        check_number("poses", self.poses)
        check_number("reach", self.reach, least=0)

    def __call__(self, key):
        """Draw all parts."""
        poses = jnp.asarray(self.poses)
        shift = self.reach * jax.random.uniform(key, poses.shape, poses.dtype, -1, 1)
        return poses + shift if self.dynamics is None else substates_at(self.dynamics, poses, shift)


def place(joint, parent, parent_anchor, part_anchor):
    """The pose ``[3, ...]`` of a part, given its joint ``[3, ...]`` and its parent.

    Args:
        joint: (offset_x, offset_y, angle).
        parent: substate of the parent, beginning with its pose.
        parent_anchor: ``[2, ...]``, the joint in the parent's coordinates.
        part_anchor: ``[2, ...]``, the joint in the part's coordinates.
    """
    theta = parent[2] + joint[2]
    x, y = rotate(parent_anchor + joint[:2], parent[2])
    back_x, back_y = rotate(part_anchor, theta)
    return jnp.stack([parent[0] + x - back_x, parent[1] + y - back_y, theta])


def substates_at(dynamics: RelativeToParent, poses: ArrayLike, shift: ArrayLike = 0.0) -> jax.Array:
    """Substates ``[P, 6]`` of parts at given poses.

    Args:
        dynamics: see ``RelativeToParent``.
        poses: ``[P, 3]``.  A gap between a part's anchors becomes its offset.
        shift: ``[P, 3]``, added to the pose of a root or of a part that walks alone, and to the
            joint of any other part; child parts follow.
    """
    poses = jnp.asarray(poses)
    shift = jnp.broadcast_to(jnp.asarray(shift, poses.dtype), poses.shape)
    anchors = [jnp.asarray(x, poses.dtype) for x in (dynamics.parent_anchor, dynamics.part_anchor)]
    substates: dict[int, jax.Array] = {}
    while len(substates) < len(dynamics.parents):
        for part, parent in enumerate(dynamics.parents):
            if part in substates or (parent >= 0 and parent not in substates):
                continue
            parent_anchor, part_anchor = (anchor[part] for anchor in anchors)
            pose, joint = poses[part] + shift[part], jnp.zeros_like(poses[part])
            if parent >= 0:
                x, y = rotate(part_anchor, poses[part, 2])
                apart = poses[part, :2] + jnp.stack([x, y]) - poses[parent, :2]
                offset = jnp.stack(rotate(apart, -poses[parent, 2])) - parent_anchor
                hangs = jnp.append(offset, poses[part, 2] - poses[parent, 2]) + shift[part]
                placed = place(hangs, substates[parent], parent_anchor, part_anchor)
                alone = False if dynamics.walks_alone is None else dynamics.walks_alone[part]
                pose, joint = jnp.where(alone, pose, placed), jnp.where(alone, joint, hangs)
            substates[part] = jnp.concatenate([pose, joint])
    return jnp.stack([substates[part] for part in range(len(substates))])


def joints_between(
    poses: ArrayLike, sizes: ArrayLike, parents: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Guess the anchors of parts from their poses, if the joints are unknown.

    A part's joint is the middle of the side nearest to its parent's centre.

    Args:
        poses: ``[P, 3]``.
        sizes: ``[P, 2]``, width and height of the rectangles, pixels.
        parents: the part tree, -1 for a root.

    Returns:
        ``parent_anchor`` and ``part_anchor``, ``[P, 2]`` each; zeros for a root.
    """
    poses, sizes = np.asarray(poses, float), np.asarray(sizes, float)
    parent_anchor, part_anchor = np.zeros(sizes.shape), np.zeros(sizes.shape)
    for part, parent in enumerate(parents):
        if parent < 0:
            continue
        sides = np.array([(-1, 0), (1, 0), (0, -1), (0, 1)]) * sizes[part] / 2
        places = poses[part, :2] + np.stack(rotate(sides.T, poses[part, 2]), axis=-1)
        apart = places - poses[parent, :2]
        nearest = int(np.argmin(np.sum(apart**2, axis=-1)))
        part_anchor[part] = sides[nearest]
        parent_anchor[part] = rotate(apart[nearest], -poses[parent, 2])
    return parent_anchor, part_anchor
