"""Likelihoods of contours with exclusion: wire frames and opaque bodies."""

import math
from functools import reduce

import jax.numpy as jnp
from jax import lax

from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.likelihoods.contours import crossings as crossing
from jaxpf.likelihoods.contours.edges import Lines
from jaxpf.likelihoods.contours.likelihood import IndependentContours, joined
from jaxpf.likelihoods.contours.union import mean_over_orders, sets_before
from jaxpf.shapes.depth import depth_orders, depths


@pytree_dataclass
class ExclusiveContours(IndependentContours):
    """Targets with exclusion: ``P`` of maccormick1999, section 3, relative to clutter.

    The boundaries of every target may cross a line, and no feature on it serves two of them.
    The targets are wire frames: all boundaries are visible, even where they overlap.  The density
    of one target alone is the weighting function of partitioned sampling.

    ``reward="literal"`` is eq. 2 as printed: an edge is rewarded on the lines of every target near
    it, so two wires side by side count twice as much as two wires apart.
    """

    def log_joint(self, observation, substates, log_probs):
        """``log(P / P_0)`` ``[]`` of all targets' substates ``[P, D]`` together."""
        return self.log_joint_all(observation, substates[..., None], log_probs[..., None])[0]

    def log_joint_all(self, observation, substates, log_probs):
        """``log(P / P_0)`` ``[N]`` of substates ``[P, D, N]``; NaN where one is not finite."""
        return self._judged_together(observation, substates, None)

    def lines_of_all(self, substates) -> Lines:
        """Measurement lines ``[M, P, N]`` of substates ``[P, D, N]``."""
        num_targets, _, num_particles = substates.shape
        flat = jnp.moveaxis(substates, 0, 1).reshape(-1, num_targets * num_particles)
        partition = jnp.repeat(jnp.arange(num_targets), num_particles)
        lines = self.lines_of(partition, flat)
        shape = self.num_lines, num_targets, num_particles
        return Lines(*(values.reshape(shape) for values in lines))

    def all_crossings(self, observation, lines, label=None):
        """Places of all targets' boundaries on all lines, and which are visible.

        First the rows of a line's own contour (``_of_their_own``), then ``crossings`` rows for each
        other target, in cyclic order after the line's own.

        Args:
            observation: of the frame.
            lines: ``[M, P, N]``.
            label: depth order, ``[N]``; None for targets that hide nothing.

        Returns:
            Places and bool, ``[C, M, P, N]``.
        """
        places, there = self._of_their_own(observation, lines)
        crossings = places, there & ~self._hidden(lines, places, label, 0)
        outline = self._outline(lines)
        for step in range(1, lines.x.shape[1]):
            other = outline._replace(
                x=jnp.roll(outline.x, -step, axis=1), y=jnp.roll(outline.y, -step, axis=1)
            )

            def is_hidden(places, step=step):
                return self._hidden(lines, places, label, step)

            crossings = joined(
                crossings,
                self._crossings_of(observation, lines, other, self.crossings, None, is_hidden),
            )
        return crossings

    def _hidden(self, lines, places, label, step):
        """Whether places on lines, of the target ``step`` after the line's own, are hidden."""
        return jnp.zeros((), bool)

    def _judged_together(self, observation, substates, label):
        """Joint log-ratio ``[N]`` of substates ``[P, D, N]``, given labels ``[N]`` or None."""
        finite = jnp.all(jnp.isfinite(substates), axis=(0, 1))
        lines = self.lines_of_all(jnp.where(finite, substates, 0.0))
        boundaries = self.all_crossings(observation, lines, label)
        if self.reward == "literal":
            every = [range(len(boundaries[0]))]
            (ratios,) = self._log_ratios(observation, lines, boundaries, every)
            (means,) = self._log_means(observation, boundaries, every)
            share = ratios * jnp.asarray(self.independence, ratios.dtype)
            joint = jnp.sum(share - means, axis=(0, 1))
        else:
            block = self.crossings
            others = [
                [(step - 1) * block + row for step in steps for row in range(block)]
                for steps in sets_before(lines.x.shape[1])
            ]
            joint = mean_over_orders(self._factors(observation, lines, boundaries, others))
        return jnp.where(finite, joint, jnp.nan)


@pytree_dataclass
class OpaqueContours(ExclusiveContours):
    """Opaque targets in depth order: ``P_occl`` of maccormick1999, section 4, relative to clutter.

    The label is the order of the targets in depth (``jaxpf.shapes.depth``).  Parts of a target's
    boundary inside the outline of a nearer target are hidden and not counted.  While nothing is
    hidden, all labels are equally likely.

    ``reward="literal"`` is eq. 5 as printed.  It rewards a contour drawn inside a nearer target
    again with that target's edge, and makes it as likely as the truth.  The paper gives eq. 5 for
    two targets; for more, the same product over all lines is used.

    Attributes:
        num_targets: static, P.
    """

    num_targets: int = static_field(default=2)

    @property
    def _rewards_folds_once(self) -> bool:
        """False: bodies rarely fold, and four clips did not tell which rule is better."""
        return False

    @property
    def orders_of_labels(self) -> tuple[tuple[int, ...], ...]:
        """Order of partitioned sampling for each label: the nearer target first (figure 8)."""
        return depth_orders(self.num_targets)

    def log_joint_all(self, observation, substates, log_probs):
        """The mean over all labels ``[N]``, for a filter without labels."""
        none = jnp.zeros(substates.shape[-1], int)
        labels = jnp.arange(len(depth_orders(substates.shape[0])))
        each = lax.map(lambda y: self._judged_together(observation, substates, none + y), labels)
        return reduce(jnp.logaddexp, each) - math.log(float(len(labels)))

    def log_joint_labelled(self, observation, substates, log_probs, label):
        """``log(P_occl / P_0)`` ``[]`` of all targets' substates ``[P, D]``, given the label."""
        return self.log_joint_labelled_all(
            observation, substates[..., None], log_probs[..., None], jnp.asarray(label)[None]
        )[0]

    def log_joint_labelled_all(self, observation, substates, log_probs, label):
        """``log(P_occl / P_0)`` ``[N]`` of substates ``[P, D, N]``, given labels ``[N]``."""
        return self._judged_together(observation, substates, label)

    def _hidden(self, lines, places, label, step):
        """Whether places ``[K, M, P, N]`` are inside any nearer target, bool."""
        outline, num_targets = self._outline(lines), lines.x.shape[1]
        x, y = lines.x + places * lines.along_x, lines.y + places * lines.along_y
        order = jnp.asarray(depth_orders(num_targets))[label]  # [N, P]
        depth = jnp.roll(jnp.asarray(depths(num_targets))[label].T, -step, axis=0)
        hidden = jnp.zeros((), bool)
        for place in range(num_targets - 1):  # the farthest target hides nothing
            nearer = crossing.Polyline(
                _of_target(outline.x, order[:, place]),
                _of_target(outline.y, order[:, place]),
                outline.joined,
            )
            hidden = hidden | ((depth > place) & crossing.is_inside(x, y, nearer))
        return hidden

    def overlap(self, substates, one=0, other=1):
        """Whether two of the targets of substates ``[P, D]`` overlap, bool ``[]``."""
        outline = self._outline(self.lines_of_all(substates[..., None]))
        first, second = (
            crossing.Polyline(outline.x[:, target], outline.y[:, target], outline.joined)
            for target in (one, other)
        )
        return crossing.overlap(first, second)[0]


def _of_target(values, target):
    """Values ``[V, N]`` of each particle's ``target`` ``[N]``, from values ``[V, P, N]``."""
    return jnp.take_along_axis(values, target[None, None], axis=1)[:, 0]
