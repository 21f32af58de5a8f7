"""Likelihoods of contours that exclude one another: wire frames, and opaque bodies."""

import jax.numpy as jnp
import numpy as np

from jaxpf.models.likelihoods.contours import crossings as crossing
from jaxpf.models.likelihoods.contours.edges import Lines
from jaxpf.models.likelihoods.contours.likelihood import IndependentContours, joined
from jaxpf.models.likelihoods.contours.union import mean_over_orders, sets_before
from jaxpf.pytree import pytree_dataclass, static_field


@pytree_dataclass
class ExclusiveContours(IndependentContours):
    """Targets that exclude one another: ``P`` of maccormick1999, section 3, relative to clutter.

    A line is crossed by the boundaries of every target, and no feature on it serves two of them.
    The targets are wire frames: all boundaries are seen, also where they overlap.  The density of
    one target alone is the weighting function of partitioned sampling.

    Attributes:
        payment: static, ``"once"`` or ``"literal"``.  With ``"once"`` an edge that lines of several
            targets show is paid for once, see ``union``, which says what density that is.
            ``"literal"`` is the product over all lines, eq. 2 as printed: a density of lines that
            are independent, which they are not.  There an edge is paid for on the lines of every
            target near it, so that two wires side by side count twice what they count apart.
    """

    payment: str = static_field(default="once")

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
        """Places of all targets' boundaries on all lines, and which are seen.

        The first ``edges`` rows are a line's own boundary, the next ``crossings - edges`` what
        else of its own contour crosses it, and then each other target has ``crossings`` rows, the
        targets in turn after the line's own.

        Args:
            observation: of the frame.
            lines: ``[M, P, N]``.
            label: who is in front, ``[N]``; None where nothing hides another.

        Returns:
            Places and bool, ``[C, M, P, N]`` with ``C = P * crossings``.
        """
        places, there = self._of_their_own(observation, lines)
        found = places, there & ~self._hidden(lines, places, label, 0)
        outline = self._outline(lines)
        for step in range(1, lines.x.shape[1]):
            other = outline._replace(
                x=jnp.roll(outline.x, -step, axis=1), y=jnp.roll(outline.y, -step, axis=1)
            )

            def is_hidden(places, step=step):
                return self._hidden(lines, places, label, step)

            found = joined(
                found,
                self._crossings_of(observation, lines, other, self.crossings, None, is_hidden),
            )
        return found

    def _hidden(self, lines, places, label, step):
        """Which places on lines are hidden, of the target ``step`` after the lines' own."""
        return jnp.zeros((), bool)

    def _judged_together(self, observation, substates, label):
        """``[N]`` of substates ``[P, D, N]`` and labels ``[N]`` or None."""
        finite = jnp.all(jnp.isfinite(substates), axis=(0, 1))
        lines = self.lines_of_all(jnp.where(finite, substates, 0.0))
        boundaries = self.all_crossings(observation, lines, label)
        joint = self._literal if self.payment == "literal" else self._once
        return jnp.where(finite, joint(observation, lines, boundaries), jnp.nan)

    def _literal(self, observation, lines, boundaries):
        every = [range(len(boundaries[0]))]
        (ratios,) = self._log_ratios(observation, lines, boundaries, every)
        (means,) = self._log_means(observation, boundaries, every)
        return jnp.sum(self._share(ratios) - means, axis=(0, 1))

    def _once(self, observation, lines, boundaries):
        block = self.crossings
        before = [
            [row for step in steps for row in range(step * block, (step + 1) * block)]
            for steps in sets_before(lines.x.shape[1])
        ]
        with_own = [[*range(block), *rows] for rows in before]
        ratios = self._log_ratios(observation, lines, boundaries, with_own + before)
        top, bottom = ratios[: len(before)], ratios[len(before) :]
        # Where lines cannot be without their target, nothing was there before it.
        possible = ~jnp.isneginf(bottom)
        ratio = jnp.where(possible, top - jnp.where(possible, bottom, 0.0), -jnp.inf)
        means = self._log_means(observation, boundaries, with_own)
        return mean_over_orders(jnp.sum(self._share(ratio) - means, axis=1))


@pytree_dataclass
class OpaqueContours(ExclusiveContours):
    """Two opaque targets, one in front: ``P_occl`` of maccormick1999, section 4, rel. to clutter.

    The label 0 says that the first target is nearer the camera, 1 the second.  What of the other
    target's boundary lies inside the nearer one's outline is hidden, and is not counted.  While
    nothing is hidden the labels are equally likely.

    With ``payment="literal"`` it is eq. 5 as printed, by which a contour that is drawn inside the
    nearer target is rewarded with that target's edge once more, and is as likely as the truth.
    """

    #: For each label the order of partitioned sampling: the nearer target first (figure 8).
    orders_of_labels = ((0, 1), (1, 0))

    def log_joint_all(self, observation, substates, log_probs):
        """The mean over both labels ``[N]``, for a filter that carries none."""
        none = jnp.zeros(substates.shape[-1], int)
        both = [self._judged_together(observation, substates, none + label) for label in (0, 1)]
        return jnp.logaddexp(*both) - np.log(2.0)

    def log_joint_labelled(self, observation, substates, log_probs, label):
        """``log(P_occl / P_0)`` ``[]`` of both targets' substates ``[2, D]``, given the label."""
        return self.log_joint_labelled_all(
            observation, substates[..., None], log_probs[..., None], jnp.asarray(label)[None]
        )[0]

    def log_joint_labelled_all(self, observation, substates, log_probs, label):
        """``log(P_occl / P_0)`` ``[N]`` of substates ``[2, D, N]``, given labels ``[N]``."""
        return self._judged_together(observation, substates, label)

    def _hidden(self, lines, places, label, step):
        """See ``ExclusiveContours``: ``[K, M, 2, N]`` bool, what lies in the nearer target."""
        outline = self._outline(lines)
        front = crossing.Polyline(
            jnp.where(label == 0, outline.x[:, 0], outline.x[:, 1]),
            jnp.where(label == 0, outline.y[:, 0], outline.y[:, 1]),
            outline.joined,
        )
        x, y = lines.x + places * lines.along_x, lines.y + places * lines.along_y
        is_behind = ((jnp.arange(2) + step) % 2)[:, None] != label
        return is_behind & crossing.is_inside(x, y, front)

    def overlap(self, substates):
        """Whether two targets' shapes ``[2, D]`` overlap, bool ``[]``."""
        outline = self._outline(self.lines_of_all(substates[..., None]))
        one, other = (
            crossing.Polyline(outline.x[:, target], outline.y[:, target], outline.joined)
            for target in range(2)
        )
        return crossing.overlap(one, other)[0]
