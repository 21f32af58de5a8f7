"""Models of articulated objects: rectangles of fixed size, connected by joints.

A part is a partition with substate (x, y, theta, ...): its centre in pixels and its angle in
radians, clockwise in the image (gonzales2011, section 4).
"""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract.calls import optional
from jaxpf.contract.model import Model, check_tree
from jaxpf.contract.pytree import as_array, pytree_dataclass
from jaxpf.contract.types import LikelihoodLike
from jaxpf.dynamics.gaussian import RandomWalk
from jaxpf.dynamics.joints import (
    RelativeToParent,
    UniformAround,
    joints_between,
    substates_at,
)
from jaxpf.likelihoods.histogram import HistogramLikelihood
from jaxpf.lowering.programs import compiled

#: Of the log odds of histograms: constant, and factors of log(d / e) and log(s + .05).
_ODDS = -5.8, -1.3, -1.6
#: Stretch that counts as none.
_STIFF = 0.05
#: Of the log odds of patches: constant and factor of log(d / e).
_ODDS_OF_PATCHES = -1.4, -4.4
#: Share of the other places that match better than e; smallest d; places per side of the grid.
_BEST, _CLOSEST, _PLACES = 0.05, 1e-3, 20


@pytree_dataclass
class OfFixedSize(contract.WrappedLikelihood):
    """Evaluates a likelihood of (u, v, scale, theta) at (x, y, 1, theta) of a part's substate.

    With d the distance between a part and its reference at the estimate (the squared distance of
    histograms, the negative log-likelihood of patches), e the 5% quantile of d at other places of
    the start frame, at the same angle, and s the stretch of a part, by how much its distance from
    its parent has changed, as a share of that at the start, the log odds that it is there are::

        histograms:  log odds = -5.8 - 1.3 log(d / e) - 1.6 log(s + .05)
        patches:     log odds = -1.4 - 4.4 log(d / e)

    Fitted by logistic regression: of histograms to "within one width of the bone" on two clips, a
    walking bear and a head with two hands (see "Parts" in docs/development/defaults.md); of patches
    to "within 21 pixels of the label" on eight limbs of the bear.

    Attributes:
        likelihood: such as ``jaxpf.likelihoods.histogram(..., method="sampled")``.
        elsewhere: e, ``[P]``, see ``with_log_odds``; without it, log odds are those of
            ``likelihood``, if it defines any.
        parents: of histograms, the parent of each part, int ``[P]``; a root is its own.
        lengths: distance of each part from its parent at the start, pixels, ``[P]``.
        slip: standard deviation in pixels of a part around the place that matches best; the
            ``model_error`` of x and y.  None is that of ``likelihood``.
    """

    likelihood: Any
    elsewhere: Any = None
    parents: Any = None
    lengths: Any = None
    slip: Any = None

    @property
    def model_error(self):
        """See ``Likelihood``."""
        if self.slip is None:
            return optional(self.likelihood, "model_error")
        return self.slip, self.slip, 0.0

    def translated(self, substates):
        """Convert substates ``[D, ...]`` to (u, v, scale, theta), ``[4, ...]``."""
        x, y, theta = substates[:3]
        return jnp.stack([x, y, jnp.ones_like(x), theta])

    @property
    def log_odds_all(self):
        """Function of (observation, partition ``[N]``, substates ``[D, N]``): log odds ``[N]``.

        Of histograms, N is the number of all parts.
        """
        if self.elsewhere is None:
            return self.__getattr__("log_odds_all")

        def log_odds_all(observation, partition, substates):
            distance = jnp.maximum(self.distance_all(observation, partition, substates), _CLOSEST)
            match = jnp.log(distance / jnp.asarray(self.elsewhere)[partition])
            if self.parents is None:
                constant, of_match = _ODDS_OF_PATCHES
                return constant + of_match * match
            constant, of_match, of_stretch = _ODDS
            stretch = self._stretch(partition, substates[:2].T)
            return constant + of_match * match + of_stretch * jnp.log(stretch + _STIFF)

        return log_odds_all

    def _stretch(self, partition, points):
        """s ``[P]`` of all parts, in any order, at points ``[P, 2]``; 0 for a root."""
        places = jnp.zeros_like(points).at[partition].set(points)
        squared = jnp.sum((points - places[jnp.asarray(self.parents)[partition]]) ** 2, axis=1)
        apart = squared > 0  # the root's derivative is infinite at 0
        distance = jnp.where(apart, jnp.sqrt(jnp.where(apart, squared, 1.0)), 0.0)
        start = jnp.asarray(self.lengths, points.dtype)[partition]
        return jnp.abs(distance - start) / jnp.maximum(start, 1.0)

    def distance_all(self, observation, partition, substates):
        """d of the log odds, ``[N]``, of substates ``[D, N]``."""
        if isinstance(self.likelihood, HistogramLikelihood):
            boxes = self.translated(substates)
            return self.likelihood.squared_distance_all(observation, partition, boxes)[0]
        return -self.log_prob_all(observation, partition, substates)


def with_log_odds(
    likelihood: LikelihoodLike,
    frame: np.ndarray,
    poses: ArrayLike,
    sizes: ArrayLike,
    parents: Sequence[int],
) -> OfFixedSize:
    """The likelihood of parts with log odds; without them if the frame shows parts alone.

    Args:
        likelihood: histograms or patches, of substates (u, v, scale, theta).
        frame: uint8 RGB ``[H, W, 3]``, the start frame.
        poses: x, y (pixels) and theta (radians) in it, ``[P, 3]``.
        sizes: width and height, pixels, ``[P, 2]``.
        parents: index of each part's parent, -1 for a root, ``[P]``.
    """
    poses, sizes = np.asarray(poses, np.float32), np.asarray(sizes, np.float32)
    across, down = ((np.arange(_PLACES) + 0.5) / _PLACES * side for side in frame.shape[1::-1])
    places = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2).astype(np.float32)
    partition = np.repeat(np.arange(len(poses)), len(places))
    substates = np.concatenate([np.tile(places, (len(poses), 1)), poses[partition, 2:]], axis=1)
    part = OfFixedSize(likelihood)
    measure = compiled(lambda frame: part.distance_all(part.observe(frame), partition, substates.T))
    distance = np.asarray(measure(jnp.asarray(frame))).reshape(len(poses), -1)
    apart = np.linalg.norm(places - poses[:, None, :2], axis=-1)
    other = apart > sizes.max(axis=1)[:, None] / 2
    if not other.any(axis=1).all():
        return part
    best = np.nanquantile(np.where(other, distance, np.nan), _BEST, axis=1)
    elsewhere = as_array(np.maximum(best, _CLOSEST), float)
    if not isinstance(likelihood, HistogramLikelihood):
        return OfFixedSize(likelihood, elsewhere)
    own = np.where(np.asarray(parents) < 0, np.arange(len(poses)), parents)
    lengths = np.linalg.norm(poses[:, :2] - poses[own, :2], axis=1)
    return OfFixedSize(likelihood, elsewhere, as_array(own), as_array(lengths, float))


def parts_model(
    likelihood: LikelihoodLike,
    poses: ArrayLike,
    sizes: ArrayLike,
    parents: Sequence[int],
    *,
    dynamics: str = "relative",
    scale: ArrayLike = (3.0, 3.0, 0.06),
    joint_scale: ArrayLike = (0.5, 0.5, 0.08),
    anchors: tuple[ArrayLike, ArrayLike] | None = None,
    reach: ArrayLike = 0.0,
) -> Model:
    """One or several articulated objects that start at given poses.

    Args:
        likelihood: of substates (u, v, scale, theta), such as
            ``jaxpf.likelihoods.histogram_from_patches(..., method="sampled")``; or from
            ``with_log_odds``.
        poses: x, y (pixels) and theta (radians), ``[P, 3]``, just before the first frame.
        sizes: width and height of the parts, pixels, ``[P, 2]``.
        parents: the part tree, -1 for a root.
        dynamics: ``"relative"``, parts follow their parents (``jaxpf.dynamics``); ``"absolute"``,
            every part follows its own random walk, as in gonzales2011.
        scale: noise of x, y and theta per frame, ``[3]`` or ``[P, 3]``: of roots, and with
            absolute dynamics of all parts.
        joint_scale: noise of a joint's offset (x, y) and angle, ``[3]`` or ``[P, 3]``.
        anchors: each part's joint in its parent's coordinates and in its own, ``[P, 2]`` each;
            by default ``jaxpf.dynamics.joints.joints_between``.
        reach: half-width of the uniform start distribution around the poses, in x, y (pixels) and
            theta (or, with relative dynamics, in the joint's offset and angle); ``[]``, ``[3]``
            or ``[P, 3]``.  0 starts all particles at the poses.
    """
    tree = check_tree(parents)
    poses, sizes = np.asarray(poses, np.float32), np.asarray(sizes, np.float32)
    scale, joint_scale = np.asarray(scale, np.float32), np.asarray(joint_scale, np.float32)
    reach = np.broadcast_to(np.asarray(reach, np.float32), (len(tree), 3))
    moves: Any = RandomWalk(scale=scale)
    start: Any = poses
    follow = None
    if dynamics == "relative":
        parent_anchor, part_anchor = anchors or joints_between(poses, sizes, tree)
        moves = follow = RelativeToParent(
            scale=scale,
            joint_scale=joint_scale,
            parent_anchor=np.asarray(parent_anchor, np.float32),
            part_anchor=np.asarray(part_anchor, np.float32),
            parents=tree,
        )
        start = substates_at(moves, poses)
    initial = UniformAround(poses, reach, follow) if reach.any() else start
    fixed = likelihood if isinstance(likelihood, OfFixedSize) else OfFixedSize(likelihood)
    return Model(moves, fixed, initial, tree)


def cut_pictures(frame: np.ndarray, poses: ArrayLike, sizes: ArrayLike) -> list[np.ndarray]:
    """Cut upright pictures out of rectangles at any angle, for learning likelihoods.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        poses: x, y (pixels) and theta (radians), ``[P, 3]``.
        sizes: width and height, pixels, ``[P, 2]``; rounded, and at least 1.

    Returns:
        P pictures, uint8 RGB ``[h, w, 3]``, sampled from the nearest pixels of the frame.
    """
    poses, sizes = np.asarray(poses, float), np.asarray(sizes, float)
    pictures = []
    for (x, y, theta), size in zip(poses, sizes, strict=True):
        width, height = np.maximum(np.rint(size).astype(int), 1)
        across = ((np.arange(width) + 0.5) / width - 0.5) * size[0]
        down = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * size[1]
        column = np.floor(x + np.cos(theta) * across - np.sin(theta) * down)
        row = np.floor(y + np.sin(theta) * across + np.cos(theta) * down)
        column = column.clip(0, frame.shape[1] - 1).astype(int)
        pictures.append(frame[row.clip(0, frame.shape[0] - 1).astype(int), column])
    return pictures
