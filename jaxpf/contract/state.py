"""State and summary, which every tracker's ``step`` returns.

The state is carried to the next frame; the summary reports this frame.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.pytree import pytree_dataclass

#: Bits of ``Summary.status``.
STATUS_OK = 0
STATUS_INVALID_LIKELIHOOD = 1  # some log-likelihoods were NaN or +inf; treated as -inf and counted
STATUS_IMPOSSIBLE = 2  # the observation was impossible for every particle; it was skipped
STATUS_WITHOUT_LIKELIHOOD = 4  # see ``Summary.without_likelihood``
STATUS_UNSUPPORTED = 8  # a traced ordering that does not work with the rest; all floats are NaN


@pytree_dataclass
class Presence:
    """Whether P objects are at their estimates, from past frames: for ``Summary.confidence``.

    Attributes:
        log_odds: ``[P]``, log odds that each object is at its estimate, smoothed over frames.
        left: ``[P]`` bool, whether each object was last seen at the frame's border; None if the
            likelihood has no ``reaches_border``.
        together: ``[P]``, 0 to 1, how long each object has been in the place of a likelier one;
            None for one object, or if the likelihood has no ``same_place``.
    """

    log_odds: jax.Array
    left: jax.Array | None = None
    together: jax.Array | None = None


@pytree_dataclass
class ParticleState:
    """A weighted set of N particles over P partitions of D dimensions.

    Arrays keep particles on the last axis, so that XLA vectorises small substates.  The
    properties ``substates`` and ``previous_substates`` return the public layout
    ``[..., N, P, D]``, with any axes that ``vmap`` or ``scan`` put in front.

    Attributes:
        lagged: ``[2, D, P, N]``, the substates of the current and the previous frame.
        log_weights: ``[N]``, normalised: their exponentials sum to one.
        lineage: ``[P, N]`` int32.  Two particles share a partition's id exactly if they carry the
            same draw of it.  Propagation assigns new ids; resampling and exchange copy them.
        component: ``[N]`` int32, the component of the ordering that each particle belongs to.
        weighted: ``[]`` bool, false for an initial set that has not been weighted yet and must not
            be resampled.
        path_scores: ``[P, N]`` zeros that carry the derivative of the log-weights, by partition
            along its own lineage (``jaxpf.gradients.StopGradient``); else None.
        label: ``[N]`` int32, each particle's discrete label, with any ordering; None if particles
            carry no labels.
        presence: whether objects are at their estimates; None without ``log_odds`` of a likelihood.
        sources: ``[P, N]`` int32, the particle of the previous frame that each draw continues, by
            partition; None unless ``Partitioned(keep_ancestors=True)`` or a wrapper requests them.
        selections: ``[]``, number of selections in this frame; the initial draws count as one.  A
            selection in some components counts as their share of the particles.  None unless
            requested.
        time: ``[]`` int32, number of frames processed, see ``jaxpf.contract.Tracker``.
    """

    lagged: jax.Array
    log_weights: jax.Array
    lineage: jax.Array
    component: jax.Array
    weighted: jax.Array
    path_scores: jax.Array | None = None
    label: jax.Array | None = None
    presence: Presence | None = None
    sources: jax.Array | None = None
    selections: jax.Array | None = None
    time: jax.Array | None = None

    @property
    def substates(self) -> jax.Array:
        """Current substates, ``[..., N, P, D]``."""
        return jnp.moveaxis(self.lagged[..., 0, :, :, :], (-1, -2, -3), (-3, -2, -1))

    @property
    def previous_substates(self) -> jax.Array:
        """Substates of the previous frame, ``[..., N, P, D]``."""
        return jnp.moveaxis(self.lagged[..., 1, :, :, :], (-1, -2, -3), (-3, -2, -1))


@pytree_dataclass
class Summary:
    """One frame's report on the weighted set, after the final weighting and before resampling.

    A filter that reports more adds a field at the end with default None.  None is not a pytree
    leaf, so code that maps over summaries, batches or devices skips it.

    Attributes:
        estimate: ``[P, D]``, weighted mean of the substates.
        log_evidence: ``[]``, log of the frame's factor in an unbiased estimate of
            ``p(y_1:T)``; ``-inf`` if the frame was impossible for every particle.  Sum the frames
            with ``jaxpf.log_evidence``: a float32 sum of 1e5 or more increments drifts.
        ess: ``[]``, effective sample size ``1 / sum(w^2)`` (maccormick1999, eq. 6); 0 if the frame
            was impossible for every particle.
        distinct_share: ``[P]``, number of distinct draws of a partition, divided by N
            (uniqueness in smith2004, section 3.1).  1 for the partition that was drawn last,
            and so with one partition.
        spread: ``[P, D]``, weighted standard deviation of the substates.
        status: ``[]`` int32, a sum of the ``STATUS_*`` bits.
        without_likelihood: ``[P]`` bool, partitions with zero likelihood in every particle of
            nonzero weight: one of the reasons for which outputs call an object lost, see
            ``jaxpf.contract.lost``.
        num_invalid: ``[]`` int32, number of log-likelihoods that were NaN or +inf.
        ess_parts: ``[P]``, effective sample size per partition if partitions have separate
            weights (``ess`` is then the smallest), 0 for one that no particle explains; else None.
        label_probabilities: ``[L]``, total weight of the particles with each label; None without
            labels.
        confidence: ``[P]``, 0 to 1, confidence that each object is present near its estimate; None
            if the likelihood has no ``log_odds``.
    """

    estimate: jax.Array
    log_evidence: jax.Array
    ess: jax.Array
    distinct_share: jax.Array
    spread: jax.Array
    status: jax.Array
    without_likelihood: jax.Array
    num_invalid: jax.Array
    ess_parts: jax.Array | None = None
    label_probabilities: jax.Array | None = None
    confidence: jax.Array | None = None


def summarise(state, log_evidence, status, lost, num_invalid, num_unique) -> Summary:
    """Build a summary: estimate, spread and effective sample size of the set, and the arguments."""
    weights = jnp.exp(state.log_weights)
    # Matrix products: on a CPU, a sum over the last axis is ten times slower.
    estimate, spread = moments(state.lagged[0], weights, jnp.matmul)
    return Summary(
        estimate=estimate.T,
        log_evidence=log_evidence,
        ess=1.0 / jnp.where(jnp.isneginf(log_evidence), jnp.inf, weights @ weights),
        distinct_share=num_unique.astype(weights.dtype) / weights.shape[0],
        spread=spread.T,
        status=status,
        without_likelihood=lost,
        num_invalid=num_invalid,
    )


def sanitised(log_values: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Replace NaN and +inf log-likelihoods by -inf, and count them, ``[]``."""
    invalid = jnp.isnan(log_values) | jnp.isposinf(log_values)
    return jnp.where(invalid, -jnp.inf, log_values), jnp.sum(invalid, dtype=jnp.int32)


def moments(
    values: jax.Array,
    weights: jax.Array,
    weighted_sum: Callable[[jax.Array, jax.Array], jax.Array],
    spread: Callable[[jax.Array], jax.Array] = lambda mean: mean[..., None],
) -> tuple[jax.Array, jax.Array]:
    """Mean and standard deviation of weighted particles; particles of zero weight may hold NaN.

    Weights sum to one but for rounding, which a mean far from 0 multiplies: so the mean is
    corrected by that of the deviations from it (Chan, Golub & LeVeque 1983).  Deviations are
    squared in units of their largest power of two, so that squares stay in range.

    Args:
        values: ``[..., N]``.
        weights: ``[N]`` or with more axes, summing to one over each set.
        weighted_sum: sums ``values * weights`` over the particles of each set.
        spread: broadcasts each set's mean to its particles.
    """
    alive = weights > 0
    values = jnp.where(alive, values, 0.0)
    mean = weighted_sum(values, weights)
    deviation = jnp.where(alive, values - spread(mean), 0.0)
    correction = weighted_sum(deviation, weights)
    deviation = jnp.where(alive, deviation - spread(correction), 0.0)
    unit = power_of_two(jnp.max(jnp.abs(deviation), axis=-1))
    root = root_or_zero(weighted_sum((deviation / unit[..., None]) ** 2, weights))
    return mean + correction, root * unit.reshape(*unit.shape, *[1] * (root.ndim - unit.ndim))


def power_of_two(sizes: jax.Array) -> jax.Array:
    """The power of two next to each size, by which scaling is exact; 1 for 0 and what is infinite.

    Has no derivative.
    """
    sizes = lax.stop_gradient(sizes)
    limits = jnp.finfo(sizes.dtype)
    proper = (sizes >= limits.tiny) & (sizes <= limits.max)
    exponent = jnp.frexp(jnp.where(proper, sizes, 0.5))[1]
    return jnp.ldexp(jnp.ones_like(sizes), exponent.clip(limits.minexp, limits.maxexp - 1))


def root_or_zero(squares: jax.Array) -> jax.Array:
    """Square roots, with derivative 0 at 0."""
    positive = squares > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, squares, 1.0)), 0.0)


def count_unique(lineage: jax.Array) -> jax.Array:
    """Count the distinct ids in every row of ``lineage`` ``[P, N]``, ids 0..N-1: ``[P]``."""
    rows = jnp.arange(lineage.shape[0])[:, None]
    present = jnp.zeros(lineage.shape, jnp.int32).at[rows, lineage].set(1)
    return jnp.sum(present, axis=-1, dtype=jnp.int32)
