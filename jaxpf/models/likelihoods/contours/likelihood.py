"""Likelihoods of contours: one target alone, several that exclude one another, opaque ones.

The substate is a point of a shape space (``jaxpf.models.shapes``).  Lines are normals of its
contour, and each is judged by the line model; lines count as independent, so that a contour's
log-likelihood is a sum over its lines (maccormick1999, eq. 2).
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import Likelihood
from jaxpf.models.likelihoods.contours import crossings as crossing
from jaxpf.models.likelihoods.contours.edges import EdgeDetector, Features, Lines
from jaxpf.models.likelihoods.contours.line_model import line_weights, log_ratio
from jaxpf.models.shapes import ShapeSpace
from jaxpf.models.splines import basis
from jaxpf.pytree import pytree_dataclass, static_field


@pytree_dataclass
class IndependentContours(Likelihood):
    """Each target alone: ``P_A`` of maccormick1999 (eq. 4), relative to clutter.

    As a likelihood of several targets it is their product ``P_A P_B``, the paper's control: one
    edge may support two targets, so that look-alikes coalesce.

    Attributes:
        space: of the substates.
        detector: of edges on the lines.
        clutter: b(n), ``[max_features + 1]``.
        detection: ``q_kc`` at ``[c, k]``; its size bounds c.
        sigma: width of the law of a boundary's feature, pixels.
        independence: share of its log-ratio that each line counts.  Neighbouring lines see the
            same blurred edge, and err alike where the shape space does; counted in full, they make
            one particle's weight exceed all others'.
        width: of a wire with two edges, pixels; what the spline draws is its middle.  Not used
            with one edge.
        edges: static, 1 where the spline is itself the boundary, 2 for both edges of a wire.
        num_lines: static, M, measurement lines per contour.
        crossings: static, at most so many crossings of one contour with one line count, those
            nearest to the line's middle.
    """

    space: ShapeSpace
    detector: EdgeDetector
    clutter: Any
    detection: Any
    sigma: Any = 7.0
    independence: Any = 1.0
    width: Any = 0.0
    edges: int = static_field(default=1)
    num_lines: int = static_field(default=32)
    crossings: int = static_field(default=1)

    #: Lines are read at whole pixels.
    state_gradient = False

    def observe(self, frame):
        """The frame's gradient, shared by all runs and particles."""
        return self.detector.observe(frame)

    def log_prob_all(self, observation, partition, substates):
        """``log(P_A / P_0)`` ``[N]`` of substates ``[D, N]``; NaN where one is not finite."""
        finite = jnp.all(jnp.isfinite(substates), axis=0)
        lines = self.lines_of(partition, jnp.where(finite, substates, 0.0))
        own = self._own_boundaries(observation, lines)
        if self.crossings > self.edges:
            own = _joined(own, self._crossings_of_itself(observation, lines))
        total = self._judged(observation, lines, *own)
        return jnp.where(finite, total, jnp.nan)

    def lines_of(self, partition, substates) -> Lines:
        """Measurement lines ``[M, N]`` of substates ``[D, N]``, pointing outwards if clockwise."""
        dtype = substates.dtype
        template = jnp.asarray(self.space.template, dtype)
        modes = jnp.asarray(self.space.modes, dtype)
        num_targets, dimension, num_points = modes.shape[:3]
        points, slopes = (jnp.asarray(matrix, dtype) for matrix in self._bases())
        both = jnp.concatenate([points, slopes])

        def matrix(control):
            """From the coordinates ``[rows]`` of control points to x, then y, ``[4M, rows]``."""
            return jnp.einsum("mk,rkc->cmr", both, control).reshape(-1, control.shape[0])

        if num_targets == 1:
            start, moved = matrix(template), matrix(modes[0]) @ substates
        else:
            # One product, in which all but each particle's own target are zero.
            is_target = (jnp.arange(num_targets)[:, None] == partition).astype(dtype)
            start = matrix(template) @ is_target
            placed = (is_target[:, None] * substates[None]).reshape(-1, substates.shape[1])
            moved = matrix(modes.reshape(num_targets * dimension, num_points, 2)) @ placed
        rows = (start + moved).reshape(2, 2, self.num_lines, -1)
        return _lines_through(rows[0, 0], rows[1, 0], rows[0, 1], rows[1, 1])

    def outline_points(self, substates) -> jax.Array:
        """Points ``[..., P, M, 2]`` along the contours of substates ``[..., P, D]``, pixels."""
        points = jnp.asarray(self._bases()[0], jnp.asarray(substates).dtype)
        return jnp.einsum("mk,...kc->...mc", points, self.space.control_points(substates))

    def _bases(self) -> tuple[np.ndarray, np.ndarray]:
        closed, degree = self.space.closed, self.space.degree
        first = 0.0 if closed else 0.5  # the ends of an open contour have no neighbours to check
        places = (np.arange(self.num_lines) + first) / self.num_lines
        num_points = np.shape(self.space.template)[1]
        kwargs: dict[str, Any] = {"closed": closed, "degree": degree}
        return basis(places, num_points, **kwargs), basis(
            places, num_points, derivative=1, **kwargs
        )

    def _offsets(self) -> list[Any]:
        half = 0.5 * jnp.asarray(self.width)
        return [0.0] if self.edges == 1 else [-half, half]

    def _own_boundaries(self, observation, lines):
        """Places ``[edges, M, N]`` of a contour's boundary on its own lines, and which are seen."""
        places = jnp.stack([jnp.full_like(lines.x, offset) for offset in self._offsets()])
        return places, self._in_view(observation, lines, places)

    def _crossings_of_itself(self, observation, lines):
        left_out = crossing.own_sides(self.num_lines, self.edges, self.space.closed)
        places, there = crossing.nearest_crossings(
            lines, self._outline(lines), self.detector.reach, self.crossings - self.edges, left_out
        )
        return places, there & self._in_view(observation, lines, places)

    def _outline(self, lines) -> crossing.Polyline:
        return crossing.outline(lines, self._offsets(), self.space.closed)

    def _in_view(self, observation, lines, places):
        """Only what is seen counts: whether places on lines lie in the frame."""
        width, height = self.detector.frame_size(observation)
        x, y = lines.x + places * lines.along_x, lines.y + places * lines.along_y
        return (x >= 0) & (x < width) & (y >= 0) & (y < height)

    def _judged(self, observation, lines, boundaries, crossed):
        """Sum over lines ``[M, ...]`` of ``log(p~_c / p_0)``, each by what it counts."""
        features: Features = self.detector.find(observation, lines)
        detector, dtype = self.detector, lines.x.dtype
        weights = line_weights(self.clutter, self.detection, detector.length)
        sigma = jnp.asarray(self.sigma, dtype)
        every = log_ratio(weights, features, boundaries, crossed, sigma, detector.reach)
        return jnp.sum(every, axis=0) * jnp.asarray(self.independence, dtype)


@pytree_dataclass
class ExclusiveContours(IndependentContours):
    """Targets that exclude one another: ``P`` of maccormick1999 (eq. 2), relative to clutter.

    A line counts the crossings of every target, and no feature on it serves two of them.  The
    targets are wire frames: all boundaries are seen, also where they overlap.  The density of
    one target alone is the weighting function of partitioned sampling.
    """

    def log_joint(self, observation, substates, log_probs):
        """``log(P / P_0)`` ``[]`` of all targets' substates ``[P, D]`` together."""
        return self.log_joint_all(observation, substates[..., None], log_probs[..., None])[0]

    def log_joint_all(self, observation, substates, log_probs):
        """``log(P / P_0)`` ``[N]`` of substates ``[P, D, N]``; NaN where one is not finite."""
        finite = jnp.all(jnp.isfinite(substates), axis=(0, 1))
        lines = self.lines_of_all(jnp.where(finite, substates, 0.0))
        boundaries, crossed = self.all_crossings(observation, lines)
        total = self._judged(observation, lines, boundaries, crossed)
        return jnp.where(finite, jnp.sum(total, axis=0), jnp.nan)

    def lines_of_all(self, substates) -> Lines:
        """Measurement lines ``[M, P, N]`` of substates ``[P, D, N]``."""
        num_targets, _, num_particles = substates.shape
        flat = jnp.moveaxis(substates, 0, 1).reshape(-1, num_targets * num_particles)
        partition = jnp.repeat(jnp.arange(num_targets), num_particles)
        lines = self.lines_of(partition, flat)
        shape = self.num_lines, num_targets, num_particles
        return Lines(*(values.reshape(shape) for values in lines))

    def all_crossings(self, observation, lines):
        """Places of all targets' boundaries on all lines, and which are there.

        The first ``edges`` rows are a line's own boundary, the next ``crossings - edges`` what
        else of its own contour crosses it, and then each other target has ``crossings`` rows, the
        targets in turn after the line's own.

        Args:
            observation: of the frame.
            lines: ``[M, P, N]``.

        Returns:
            Places and bool, ``[C, M, P, N]`` with ``C = P * crossings``.
        """
        found = self._own_boundaries(observation, lines)
        if self.crossings > self.edges:
            found = _joined(found, self._crossings_of_itself(observation, lines))
        outline = self._outline(lines)
        for step in range(1, lines.x.shape[1]):
            other = outline._replace(
                x=jnp.roll(outline.x, -step, axis=1), y=jnp.roll(outline.y, -step, axis=1)
            )
            places, there = crossing.nearest_crossings(
                lines, other, self.detector.reach, self.crossings
            )
            there = there & self._in_view(observation, lines, places)
            found = _joined(found, (places, there))
        return found


@pytree_dataclass
class OpaqueContours(ExclusiveContours):
    """Two opaque targets, one in front: ``P_occl`` of maccormick1999 (eq. 5), rel. to clutter.

    The label 0 says that the first target is nearer the camera, 1 the second.  What of the other
    target's boundary lies inside the nearer one's outline is hidden, and is not counted.
    """

    #: For each label the order of partitioned sampling: the nearer target first (figure 8).
    orders_of_labels = ((0, 1), (1, 0))

    def log_joint(self, observation, substates, log_probs):
        """The mean over both labels, for a filter that carries none."""
        both = jnp.stack(
            [
                self.log_joint_labelled(observation, substates, log_probs, jnp.asarray(label))
                for label in (0, 1)
            ]
        )
        return jax.nn.logsumexp(both) - np.log(2.0)

    def log_joint_labelled(self, observation, substates, log_probs, label):
        """``log(P_occl / P_0)`` ``[]`` of both targets' substates ``[2, D]``, given the label."""
        return self.log_joint_labelled_all(
            observation, substates[..., None], log_probs[..., None], jnp.asarray(label)[None]
        )[0]

    def log_joint_labelled_all(self, observation, substates, log_probs, label):
        """``log(P_occl / P_0)`` ``[N]`` of substates ``[2, D, N]``, given labels ``[N]``."""
        finite = jnp.all(jnp.isfinite(substates), axis=(0, 1))
        lines = self.lines_of_all(jnp.where(finite, substates, 0.0))
        boundaries, crossed = self.all_crossings(observation, lines)
        seen = crossed & ~self.hidden(lines, boundaries, label)
        total = self._judged(observation, lines, boundaries, seen)
        return jnp.where(finite, jnp.sum(total, axis=0), jnp.nan)

    def hidden(self, lines, boundaries, label):
        """Which boundaries ``[C, M, 2, N]`` lie behind the nearer target, bool."""
        outline = self._outline(lines)
        front = crossing.Polyline(
            jnp.where(label == 0, outline.x[:, 0], outline.x[:, 1]),
            jnp.where(label == 0, outline.y[:, 0], outline.y[:, 1]),
            outline.joined,
        )
        x, y = lines.x + boundaries * lines.along_x, lines.y + boundaries * lines.along_y
        # Whose boundary it is: a row's own target's, or, from `crossings` on, the other's.
        is_other = np.arange(boundaries.shape[0]) >= self.crossings
        owner = np.arange(2)[None, :] ^ is_other[:, None]
        is_behind = jnp.asarray(owner)[:, None, :, None] != label
        return is_behind & crossing.is_inside(x, y, front)

    def overlap(self, substates):
        """Whether two targets' shapes ``[2, D]`` overlap, bool ``[]``."""
        outline = self._outline(self.lines_of_all(substates[..., None]))
        one, other = (
            crossing.Polyline(outline.x[:, target], outline.y[:, target], outline.joined)
            for target in range(2)
        )
        return crossing.overlap(one, other)[0]


def _lines_through(x, y, slope_x, slope_y) -> Lines:
    """Normals at points of a curve; where the curve has no direction, a line sees nothing."""
    square = slope_x**2 + slope_y**2
    directed = (square > 0) & jnp.isfinite(square) & jnp.isfinite(x) & jnp.isfinite(y)
    scale = jnp.where(directed, 1 / jnp.sqrt(jnp.where(directed, square, 1.0)), 0.0)
    return Lines(
        jnp.where(directed, x, -1e4),
        jnp.where(directed, y, -1e4),
        jnp.where(directed, slope_y * scale, 1.0),
        jnp.where(directed, -slope_x * scale, 0.0),
    )


def _joined(one, other):
    return tuple(jnp.concatenate(pair) for pair in zip(one, other, strict=True))
