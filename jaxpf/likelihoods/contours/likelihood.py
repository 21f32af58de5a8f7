"""The likelihood of contours without exclusion: each is evaluated alone.

The substate is a point of a shape space (``jaxpf.shapes.spaces``).  Measurement lines are normals
of its contour, and the line model gives each a log-ratio; a contour's log-likelihood is their sum
(maccormick1999, eq. 2).  A contour that folds back on itself shows one edge to the lines of both
legs; ``union`` explains how that edge is rewarded only once.
"""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.likelihoods.contours import crossings as crossing
from jaxpf.likelihoods.contours.edges import EdgeDetector, Features, Lines
from jaxpf.likelihoods.contours.line_model import line_weights, log_ratios
from jaxpf.likelihoods.contours.share import log_mean_of, log_means
from jaxpf.lowering.programs import compiled
from jaxpf.shapes.spaces import ShapeSpace
from jaxpf.shapes.splines import basis

#: Number of crossings of a contour with one line that are searched for visible ones.
_CANDIDATES = 4
#: Slope and level of ``log_odds_all``.
_ODDS = 30.0, 0.9
#: Share of its edges that a contour on film shows, and the least that ``started`` assumes.
_SHOWN, _LEAST_SHOWN = 0.65, 0.4


class Observation(NamedTuple):
    """The observation of a frame.

    Attributes:
        gradient: see ``EdgeDetector.observe``.
        log_means: see ``share``.
    """

    gradient: jax.Array
    log_means: jax.Array


@pytree_dataclass
class IndependentContours(Likelihood):
    """Each target alone: ``P_A`` of maccormick1999 (eq. 4), relative to clutter.

    For several targets it is the product ``P_A P_B``, the paper's control: one edge may support
    two targets, so look-alikes coalesce.

    Attributes:
        space: the shape space of the substates.
        detector: of edges on the lines.
        clutter: b(n), ``[max_features + 1]``.
        detection: ``q_kc`` at ``[c, k]``; its size bounds c.
        sigma: standard deviation of a boundary's feature, pixels.
        independence: weight of each line's log-ratio; a constant is subtracted so that the result
            is a density.  See ``share`` for the reason, and for cases in which it is one only
            approximately.
        width: of a wire with two edges, pixels; the spline is its centreline.  Not used with one
            edge.
        at_start: share of its edges that each target showed when it was marked, ``[P]`` or ``[]``,
            above 0; see ``started``, which gives .4 at least.
        slip: standard deviation in pixels of a target around the contour that matches best, ``[P]``
            or ``[]``, since lines show how far an edge is off across a contour, not along it; the
            ``model_error`` of x and y.
        edges: static, 1 if the spline is itself the boundary, 2 for both edges of a wire.
        num_lines: static, M, measurement lines per contour.
        crossings: static, maximum number of crossings of one contour with one line that are
            used, those nearest to the line's middle.
        reward: static, ``"once"`` or ``"literal"``.  With ``"once"`` an edge that several lines
            show is rewarded once, see ``union``.  ``"literal"`` is the product over all lines as
            printed, with which a contour folded back on half of its length scores like the truth.
    """

    space: ShapeSpace
    detector: EdgeDetector
    clutter: jax.Array
    detection: jax.Array
    sigma: ArrayLike = 7.0
    independence: ArrayLike = 1.0
    width: ArrayLike = 0.0
    at_start: Any = _SHOWN
    slip: ArrayLike = 0.0
    edges: int = static_field(default=1)
    num_lines: int = static_field(default=32)
    crossings: int = static_field(default=1)
    reward: str = static_field(default="once")

    #: Lines are read at whole pixels, so there is no gradient.
    state_gradient = False

    def observe(self, frame):
        """The frame's gradient and the lines' normalising constants, for all runs and particles."""
        means = log_means(
            self.clutter,
            self.detection,
            jnp.asarray(self.sigma),
            jnp.asarray(self.independence),
            self._offsets(),
            self.detector.length,
        )
        return Observation(self.detector.observe(frame), means)

    def log_prob_all(self, observation, partition, substates):
        """``log(P_A / P_0)`` ``[N]`` of substates ``[D, N]``; NaN where one is not finite."""
        finite = jnp.all(jnp.isfinite(substates), axis=0)
        lines = self.lines_of(partition, jnp.where(finite, substates, 0.0))
        own = self._of_their_own(observation, lines)
        (total,) = self._factors(observation, lines, own, [[]])
        return jnp.where(finite, total, jnp.nan)

    @property
    def model_error(self):
        """Standard deviations of the truth around the best match: the slip in x and y."""
        return np.multiply.outer(np.asarray(self.slip), (1.0, 1.0, 0.0))

    def log_odds_all(self, observation, partition, substates):
        """Log odds ``[N]`` that targets are where they are reported, at ``[D, N]``.

        ``30 (t / t_0 - .9)``, with t the share of a contour's edges that the frame shows and t_0
        that at the start.  Look-alikes count as the target, hidden edges as missed ones.
        """
        at_start = jnp.asarray(self.at_start, substates.dtype)
        slope, level = _ODDS
        shown = self._edges_shown(observation, partition, substates)
        return slope * (shown / (at_start[partition] if at_start.ndim else at_start) - level)

    def started(self, frame, substates):
        """This likelihood with ``at_start`` of targets marked in a start frame.

        Args:
            frame: uint8 RGB ``[H, W, 3]``.
            substates: of all targets in it, ``[P, D]``.
        """
        return dataclasses.replace(self, at_start=_shown_at_start(self, frame, substates))

    def _edges_shown(self, observation, partition, substates):
        """Share ``[N]`` of their own edges that contours ``[D, N]`` show.

        The mean, over lines with an edge inside the frame, of the log-ratio of these edges to
        clutter, scaled so that a line without a feature has 0, and one with a feature at every edge
        and no other 1; lines with several features can give more.  0 if no edge is in the frame.
        """
        finite = jnp.all(jnp.isfinite(substates), axis=0)
        lines = self.lines_of(partition, jnp.where(finite, substates, 0.0))
        own, every = self._own_boundary(observation, lines), [range(self.edges)]
        (ratios,) = self._log_ratios(observation, lines, own, every)
        edges = jnp.asarray(self._offsets(), lines.x.dtype)[:, None]
        is_found = jnp.array([[False, True]] * self.edges)
        none, full = self._ratios_of(Features(edges, is_found), (edges, edges == edges), every)[0]
        # A line whose edges are all outside has the ratio 0 of clutter, which says nothing.
        counts = jnp.any(own[1], axis=0)
        total = jnp.sum(jnp.where(counts, ratios - none, 0.0), axis=0) / (full - none)
        return jnp.where(finite, total / jnp.maximum(jnp.sum(counts, axis=0), 1), jnp.nan)

    def lines_of(self, partition, substates) -> Lines:
        """Measurement lines ``[M, N]`` of substates ``[D, N]``; outwards on clockwise contours."""
        points, slopes = (jnp.asarray(matrix, substates.dtype) for matrix in self._bases())
        both = self.space.points_all(jnp.concatenate([points, slopes]), partition, substates)
        rows = both.reshape(2, 2, self.num_lines, -1)
        return _lines_through(rows[0, 0], rows[1, 0], rows[0, 1], rows[1, 1])

    def outline_points(self, substates) -> jax.Array:
        """Points ``[..., P, M, 2]`` along the contours of substates ``[..., P, D]``, pixels."""
        points = jnp.asarray(self._bases()[0], jnp.asarray(substates).dtype)
        return jnp.einsum("mk,...kc->...mc", points, self.space.control_points(substates))

    def _bases(self) -> tuple[np.ndarray, np.ndarray]:
        closed, degree = self.space.closed, self.space.degree
        first = 0.0 if closed else 0.5  # avoids lines at the very ends of an open contour
        places = (np.arange(self.num_lines) + first) / self.num_lines
        matrix = partial(basis, places, self.space.num_points, closed=closed, degree=degree)
        return matrix(), matrix(derivative=1)

    def _offsets(self) -> list[Any]:
        half = 0.5 * jnp.asarray(self.width)
        return [0.0] if self.edges == 1 else [-half, half]

    def _own_boundary(self, observation, lines):
        """Places ``[edges, M, ...]`` of the boundary that a line belongs to, and those visible."""
        places = jnp.stack([jnp.full_like(lines.x, offset) for offset in self._offsets()])
        return places, self._in_view(observation, lines, places)

    def _of_their_own(self, observation, lines):
        """Places ``[crossings, M, ...]`` of a contour on its own lines, and which are visible.

        The first ``edges`` rows are the boundary that a line belongs to.  The others are further
        crossings of the same contour; with reward ``"once"``, only those of its earlier pieces.
        """
        own = self._own_boundary(observation, lines)
        further = self._own_rows - self.edges
        if not further:
            return own
        kind = self.num_lines, self.edges, self.space.closed
        outline = self._outline(lines)
        if not self._rewards_folds_once:
            left_out = crossing.own_sides(*kind)
            return joined(own, self._crossings_of(observation, lines, outline, further, left_out))
        places, there = crossing.nearest_crossings(
            lines, outline, self.detector.reach, further, crossing.sides_from(*kind)
        )
        return joined(own, (places, there & self._in_view(observation, lines, places)))

    @property
    def _rewards_folds_once(self) -> bool:
        """Whether an edge that a contour folded back on itself shows twice is rewarded once."""
        return self.reward == "once"

    @property
    def _own_rows(self) -> int:
        """Number of rows of ``_of_their_own``."""
        return self.crossings + (self.edges if self._rewards_folds_once else 0)

    def _factors(self, observation, lines, boundaries, others):
        """Log-factors of contours from their own lines: sums over lines, ``[S, ...]``.

        Args:
            observation: of the frame.
            lines: ``[M, ...]``.
            boundaries: places ``[C, M, ...]`` and which are visible; own rows first.
            others: S groups of rows, counted after the own ones: boundaries that were there before.
        """

        def gains(num_own, boundaries):
            rows = [[num_own + row for row in group] for group in others]
            after = [[*range(num_own), *group] for group in rows]
            earlier = range(self.edges, num_own) if self._rewards_folds_once else ()
            before = [[*earlier, *group] for group in rows]
            groups = after + before if any(before) else after
            ratios = self._log_ratios(observation, lines, boundaries, groups)
            ratio, given = ratios[: len(after)], ratios[len(after) :]
            if any(before):
                # If the earlier boundaries alone make a line impossible, the ratio counts as 0.
                possible = ~jnp.isneginf(given)
                ratio = jnp.where(possible, ratio - jnp.where(possible, given, 0.0), -jnp.inf)
            share = ratio * jnp.asarray(self.independence, ratio.dtype)
            return jnp.sum(share - self._log_means(observation, boundaries, after), axis=1)

        num_own, edges = self._own_rows, self.edges
        if not self._rewards_folds_once:
            return gains(num_own, boundaries)
        # Contours rarely fold back: pay for these rows only if one does.
        folds = crossing.anywhere(boundaries[1][edges:num_own])
        return lax.cond(
            folds,
            lambda every: gains(num_own, every),
            lambda every: gains(
                edges, tuple(jnp.concatenate([rows[:edges], rows[num_own:]]) for rows in every)
            ),
            boundaries,
        )

    def _crossings_of(self, observation, lines, polyline, keep, left_out=None, is_hidden=None):
        """The visible crossings ``[keep, M, ...]`` nearest to the lines' middles, and which exist.

        Invisible crossings do not displace visible ones.
        """
        count = max(keep, _CANDIDATES)
        places, there = crossing.nearest_crossings(
            lines, polyline, self.detector.reach, count, left_out
        )
        there = there & self._in_view(observation, lines, places)
        if is_hidden is not None:
            there = there & ~is_hidden(places)
        return crossing.first(places, there, keep)

    def _outline(self, lines) -> crossing.Polyline:
        return crossing.outline(lines, self._offsets(), self.space.closed)

    def _in_view(self, observation, lines, places):
        """Whether places on lines lie in the frame, since only visible boundaries count."""
        width, height = self.detector.frame_size(observation.gradient)
        x, y = lines.x + places * lines.along_x, lines.y + places * lines.along_y
        return (x >= 0) & (x < width) & (y >= 0) & (y < height)

    def _log_ratios(self, observation, lines, boundaries, groups):
        """``log(p~_c / p_0)`` of lines ``[M, ...]``, from the places of visible boundaries.

        ``[groups, M, ...]``: for each group of rows, as if only these boundaries crossed the lines.
        """
        features = self.detector.find(observation.gradient, lines)
        return self._ratios_of(features, boundaries, groups)

    def _ratios_of(self, features: Features, boundaries, groups):
        """``_log_ratios`` of lines with these features."""
        places, seen = boundaries
        weights = line_weights(self.clutter, self.detection, self.detector.length)
        sigma, reach = jnp.asarray(self.sigma, places.dtype), self.detector.reach
        return log_ratios(weights, features, places, seen, sigma, reach, groups)

    def _log_means(self, observation, boundaries, groups):
        """Log normalising constants ``[groups, M, ...]`` of lines ``[M, ...]``, see ``share``.

        Every group of rows includes the line's own boundary, the first ``edges`` rows.
        """
        places, seen = boundaries
        own = jnp.sum(seen[: self.edges], axis=0, dtype=jnp.int32)
        table = jnp.asarray(observation.log_means, places.dtype)
        others = np.arange(self.edges, places.shape[0])[:, None]
        there = np.concatenate([np.isin(others, np.array(group)) for group in groups], axis=1)
        there = there.reshape(*there.shape, *[1] * own.ndim) & seen[self.edges :, None]
        return log_mean_of(table, own, places[self.edges :, None], there, self.detector.reach)


@compiled
def _shown_at_start(likelihood: IndependentContours, frame, substates):
    """``at_start`` ``[P]`` of ``started``; compiled whole, since single operations take seconds."""
    places = jnp.asarray(substates).T
    observation = likelihood.observe(frame)
    shown = likelihood._edges_shown(observation, jnp.arange(places.shape[1]), places)
    return jnp.maximum(shown, _LEAST_SHOWN)


def _lines_through(x, y, slope_x, slope_y) -> Lines:
    """Normals at points of a curve; where the curve has no direction, a line outside the frame."""
    square = slope_x**2 + slope_y**2
    directed = (square > 0) & jnp.isfinite(square) & jnp.isfinite(x) & jnp.isfinite(y)
    scale = jnp.where(directed, 1 / jnp.sqrt(jnp.where(directed, square, 1.0)), 0.0)
    return Lines(
        jnp.where(directed, x, -1e4),
        jnp.where(directed, y, -1e4),
        jnp.where(directed, slope_y * scale, 1.0),
        jnp.where(directed, -slope_x * scale, 0.0),
    )


def joined(one, other):
    """Concatenate two groups of rows of boundaries, with their masks."""
    return tuple(jnp.concatenate(pair) for pair in zip(one, other, strict=True))
