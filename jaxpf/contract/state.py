"""What a tracker carries from frame to frame, and what a frame reports.

The state is carried, the summary is reported: every tracker's ``step`` returns both.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import pytree_dataclass

#: Bits of ``Summary.status``.
STATUS_OK = 0
STATUS_INVALID_LIKELIHOOD = 1  # some log-likelihoods were NaN or +inf: taken as -inf and counted
STATUS_IMPOSSIBLE = 2  # an observation was impossible for every particle: it was left out
STATUS_LOST = 4  # some partition had zero likelihood in every particle (see ``Summary.lost``)


@pytree_dataclass
class ParticleState:
    """A weighted set of N particles over P partitions of D dimensions.

    Inside, particles stand on the last axis, which lets XLA vectorise small substates;
    the properties ``substates`` and ``previous_substates`` give the public layout
    ``[..., N, P, D]`` whatever axes ``vmap`` or ``scan`` put in front.

    Attributes:
        lagged: ``[2, D, P, N]``, the substates of the current frame and of the one before.
        log_weights: ``[N]``, normalised: their exponentials sum to one.
        lineage: ``[P, N]`` int32.  Two particles share a partition's id exactly when they
            carry the same draw of it; ids are renewed when the partition is propagated and
            copied by resampling and exchange.
        component: ``[N]`` int32, the component of the ordering that each particle belongs to.
        weighted: ``[]`` bool, false only for a set that was drawn and never weighed, which
            must not be resampled.
        path_scores: ``[P, N]`` zeros with a derivative: that of the log-weights, by
            partition, each along its own lineage (``jaxpf.gradients.StopGradient``); else None.
        label: ``[N]`` int32, each particle's discrete label, whatever the ordering; None where
            particles carry none.
        log_odds: ``[P]``, that each object is where it is reported, smoothed over the frames so
            far; None if the likelihood has no ``log_odds``.
        sources: ``[P, N]`` int32, which particle of the frame before each draw continues, for
            ``jaxpf.filters``; None unless asked for.
        selections: ``[]``, how many selections this frame made, the draws of the first frame being
            one; a selection of some components counts as their share.  None unless asked for.
    """

    lagged: jax.Array
    log_weights: jax.Array
    lineage: jax.Array
    component: jax.Array
    weighted: jax.Array
    path_scores: jax.Array | None = None
    label: jax.Array | None = None
    log_odds: jax.Array | None = None
    sources: jax.Array | None = None
    selections: jax.Array | None = None

    @property
    def substates(self) -> jax.Array:
        """Current substates, ``[..., N, P, D]``."""
        return jnp.moveaxis(self.lagged[..., 0, :, :, :], (-1, -2, -3), (-3, -2, -1))

    @property
    def previous_substates(self) -> jax.Array:
        """Substates one frame earlier, ``[..., N, P, D]``."""
        return jnp.moveaxis(self.lagged[..., 1, :, :, :], (-1, -2, -3), (-3, -2, -1))


@pytree_dataclass
class Summary:
    """What one frame reports: the weighted set after its last weighing.

    The next frame begins by resampling it.

    A filter with more to report adds a field at the end whose default is None.  None is no leaf
    of a pytree: all that maps over summaries, batches and devices passes it by.

    Attributes:
        estimate: ``[P, D]``, weighted mean of the substates.
        log_evidence: ``[]``, log of the frame's factor in an unbiased estimate of
            ``p(y_1:T)``; ``-inf`` if the frame was impossible for every particle.
        ess: ``[]``, effective sample size ``1 / sum(w^2)`` (maccormick1999, eq. 6).
        uniqueness: ``[P]``, distinct draws of a partition over N (smith2004, section 3.1).
        spread: ``[P, D]``, weighted standard deviation of the substates.
        status: ``[]`` int32, a sum of the ``STATUS_*`` bits.
        lost: ``[P]`` bool, partitions whose likelihood was zero in every particle that still
            had weight.
        num_invalid: ``[]`` int32, log-likelihoods that were NaN or +inf.
        ess_parts: ``[P]``, every partition's effective sample size, where each has weights of
            its own (``ess`` is then the smallest); else None.
        label_probabilities: ``[L]``, weight of the particles with each label; None without labels.
        confidence: ``[P]``, 0 to 1, how sure it is that each object is still there, near its
            estimate; None if the likelihood has no ``log_odds``.
    """

    estimate: jax.Array
    log_evidence: jax.Array
    ess: jax.Array
    uniqueness: jax.Array
    spread: jax.Array
    status: jax.Array
    lost: jax.Array
    num_invalid: jax.Array
    ess_parts: jax.Array | None = None
    label_probabilities: jax.Array | None = None
    confidence: jax.Array | None = None


def summarise(state, log_evidence, status, lost, num_invalid, num_unique) -> Summary:
    """Estimate, effective sample size and spread of a weighted set, and what is known of it."""
    weights = jnp.exp(state.log_weights)
    # Products with a matrix: a sum over the last axis is ten times slower on CPU.
    estimate, spread = moments(state.lagged[0], weights, jnp.matmul)
    return Summary(
        estimate=estimate.T,
        log_evidence=log_evidence,
        ess=1.0 / (weights @ weights),
        uniqueness=num_unique.astype(weights.dtype) / weights.shape[0],
        spread=spread.T,
        status=status,
        lost=lost,
        num_invalid=num_invalid,
    )


def sanitised(log_values: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Log-likelihoods of which NaN and +inf are taken as -inf, and how many were so, ``[]``."""
    invalid = jnp.isnan(log_values) | jnp.isposinf(log_values)
    return jnp.where(invalid, -jnp.inf, log_values), jnp.sum(invalid, dtype=jnp.int32)


def moments(
    values: jax.Array,
    weights: jax.Array,
    weighted_sum: Callable[[jax.Array, jax.Array], jax.Array],
    spread: Callable[[jax.Array], jax.Array] = lambda mean: mean[..., None],
) -> tuple[jax.Array, jax.Array]:
    """Mean and standard deviation of weighted particles; one without weight may hold NaN.

    Args:
        values: ``[..., N]``.
        weights: ``[N]`` or more axes, summing to one in whatever is summed.
        weighted_sum: of values and weights, over the particles of a set.
        spread: gives every particle its set's mean.
    """
    alive = weights > 0
    values = jnp.where(alive, values, 0.0)
    mean = weighted_sum(values, weights)
    deviation = jnp.where(alive, values - spread(mean), 0.0)
    variance = weighted_sum(deviation**2, weights)
    return mean, jnp.where(variance > 0, jnp.sqrt(jnp.where(variance > 0, variance, 1.0)), 0.0)


def count_unique(lineage: jax.Array) -> jax.Array:
    """``[P]``: the number of distinct ids, each in 0..N-1, in every row of ``[P, N]``."""
    rows = jnp.arange(lineage.shape[0])[:, None]
    present = jnp.zeros(lineage.shape, jnp.int32).at[rows, lineage].set(1)
    return jnp.sum(present, axis=-1, dtype=jnp.int32)
