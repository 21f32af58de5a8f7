"""Monte Carlo error from one run: the genealogical variance estimator, and its fixed-lag form.

Particles that descend from the same draw have correlated errors, so the variance between runs
depends on each ancestor's contribution to the answer (Chan & Lai 2013; Lee & Whiteley 2018).  Let w
be the weights, ``sum_i w_i f_i`` the answer, and S_e the part of ``sum_i w_i (f_i - answer)`` from
the descendants of ancestor e.  Then ::

    variance = (N / (N - 1))^G  sum_e S_e^2

over G generations of particles.  For the evidence, f is 1 and nothing is subtracted; its relative
variance ``1 - (N / (N - 1))^G (1 - sum_e S_e^2)`` is unbiased.

*Time steps.*  A frame of partitioned sampling has one generation per selection.

*Lag.*  In long clips all particles soon descend from one ancestor, and the sum carries no
information.  Using ancestors a fixed number of frames back avoids this, but ignores older variance
(Olsson & Douc 2019).  With fewer than sqrt(N) ancestors the variance is NaN.  If most runs give
NaN, the variance from the others is too small, because they are the lucky ones.

*Adaptive resampling.*  With ``ess_threshold``, G counts only the selections that happen.

*Validity.*  Theory covers multinomial resampling at every selection, without exchange.  With
systematic resampling, DPS and SPS the variance of estimates was measured to be right to some ten
per cent, and with joint weighting a third too small.  That of the evidence under systematic
resampling is far too small, because the estimator subtracts the variance of multinomial draws: it
is reported with multinomial resampling alone; otherwise compare runs.  With exchange, each
partition has its own ancestors, and the evidence has no standard error.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import contract
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError, check_separate
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import compiled_alone, is_concrete, pytree_dataclass, static_field
from jaxpf.contract.state import ParticleState, Summary
from jaxpf.filters.partitioned.tracker import Partitioned


@pytree_dataclass
class Ancestry:
    """A filter's state, and the ancestors of its particles.

    Attributes:
        state: the filter's state.
        families: ``[K, Q, N]`` int32, the slot in which each particle's ancestor was drawn, k
            frames ago; without a lag, at the start of the clip, with K = 1.  Q is P if each
            partition has its own ancestors, else 1.
        selections: ``[K]``, number of selections per frame, latest frame first, or with K = 1 over
            all frames; None if no selection is skipped.
    """

    state: ParticleState
    families: jax.Array
    selections: jax.Array | None = None

    @property
    def time(self) -> Any:
        """Number of frames processed, ``[]`` int32."""
        return self.state.time


@pytree_dataclass
class ErrorBars(Summary):
    """A ``Summary`` with the Monte Carlo variance of its estimate and evidence.

    Attributes:
        estimate_variance: ``[P, D]``, variance of ``estimate`` over runs; NaN if unknown.
        evidence_variance: ``[]``, relative variance of the evidence of all frames processed, about
            the variance of its logarithm.  NaN if unknown, with exchange, with any resampling
            other than multinomial, and, with a lag, after the first ``lag + 1`` frames.
        num_ancestors: ``[P]`` int32, number of distinct ancestors per partition.
        unknown: ``[P]`` bool, fewer than sqrt(N) ancestors, too few for a variance.
    """

    estimate_variance: jax.Array | None = None
    evidence_variance: jax.Array | None = None
    num_ancestors: jax.Array | None = None
    unknown: jax.Array | None = None

    @property
    def estimate_error(self) -> jax.Array:
        """Standard error of ``estimate``, ``[P, D]``."""
        return jnp.sqrt(jnp.asarray(self.estimate_variance))


@pytree_dataclass
class WithErrorBars(contract.WrappedTracker):
    """A filter that also reports its Monte Carlo variance; estimates and evidence are unchanged.

    With a lag it leaves out the variance that is older, so the error is too small where particles
    share their ancestors for longer.  ``SideBySide`` answers the same from several runs, unbiased.

    Attributes:
        tracker: a ``jaxpf.Partitioned``.
        lag: static, number of frames to look back; None looks back to the start of the clip.
        by_partition: static, whether partitions may have their own ancestors; set by the
            constructor: if the ordering exchanges parts, or is traced.

    Raises:
        InputError: another filter; transport, which has no ancestors; a lag below 0.
    """

    tracker: Partitioned
    lag: int | None = static_field(default=None)
    by_partition: bool = static_field(default=False, init=False)

    def __post_init__(self):
        tracker = self.tracker
        if optional(tracker, "moments"):
            raise InputError(
                "Monte Carlo standard errors need states that are arrays, not pytrees; make the "
                "state one array."
            )
        blends = tracker.gradient.blends
        check_separate("WithErrorBars", (blends, "gradient Transport, which blends particles"))
        exchanges = tracker.ordering.exchanges
        by_partition = not is_concrete(exchanges) or bool(np.any(exchanges))
        object.__setattr__(self, "by_partition", by_partition)
        if self.lag is not None:
            check_whole("lag", self.lag, 0)

    @compiled_alone
    def init(self, key: jax.Array) -> Ancestry:
        """Return the filter's initial state, in which every particle is its own ancestor."""
        state = self.tracker.init(key)
        shape = (self.num_partitions, self.tracker.num_particles)
        rows = (
            1 if self.lag is None else self.lag + 1,
            shape[0] if self.by_partition else 1,
        )
        identity = jnp.arange(shape[1], dtype=jnp.int32)
        adaptive = self.tracker.ess_threshold is not None
        none_yet = jnp.zeros(rows[:1], state.log_weights.dtype)
        return Ancestry(
            state=dataclasses.replace(
                state,
                sources=jnp.zeros(shape, jnp.int32),
                selections=none_yet[0] if adaptive else None,
            ),
            families=jnp.broadcast_to(identity, (*rows, shape[1])),
            selections=none_yet if adaptive else None,
        )

    def step_observed(
        self, key: jax.Array, state: Ancestry, observation: Any
    ) -> tuple[Ancestry, ErrorBars]:
        """Advance the filter by one frame and trace the particles' ancestors."""
        inner, summary = self.tracker.step_observed(key, state.state, observation)
        families = self._families(inner, state.families)
        selections = state.selections
        if selections is not None:
            kept = selections if self.lag is None else jnp.roll(selections, 1).at[0].set(0)
            selections = kept.at[0].add(inner.selections)
        state = Ancestry(inner, families, selections)
        return state, self._report(state, summary)

    def _families(self, state: ParticleState, before: jax.Array) -> jax.Array:
        """Return ``families`` after this frame."""
        ordering, sources = self.tracker.ordering, jnp.asarray(state.sources)
        # Without exchange a particle has one ancestor for all partitions, as of the first stage.
        drawn_first = ordering.order[state.component, 0], jnp.arange(sources.shape[1])
        if not self.by_partition:
            sources = sources[drawn_first][None]
        handed_on = jnp.take_along_axis(before, sources[None], axis=-1)
        if self.lag is None:
            return handed_on
        own = state.lineage[drawn_first][None]
        if self.by_partition:
            own = jnp.where(ordering.exchanges, state.lineage, own)
        return jnp.concatenate([own[None], handed_on[:-1]])

    def _report(self, state: Ancestry, summary: Summary) -> ErrorBars:
        tracker, num_particles = self.tracker, self.tracker.num_particles
        weights = jnp.exp(state.state.log_weights)
        values = jnp.where(weights > 0, state.state.lagged[0], 0.0) - summary.estimate.T[..., None]
        parts = jnp.where(weights > 0, values, 0.0) * weights  # [D, P, N]

        def squares(family: jax.Array, part: jax.Array) -> jax.Array:
            """Sums ``[D]`` of squares over families ``[N]``."""
            shares = jnp.zeros(part.shape, part.dtype).at[:, family].add(part)
            return jnp.sum(shares**2, axis=1)

        oldest = state.families[-1]  # [Q, N]
        of_parts = jnp.broadcast_to(oldest, (self.num_partitions, num_particles))
        of_values = jax.vmap(squares, in_axes=(0, 1))(of_parts, parts)  # [P, D]
        of_weights = squares(oldest[0], weights[None])[0]

        selections = jnp.sum(tracker.ordering.resample_after, dtype=jnp.int32) + 1
        looked_back = state.time if self.lag is None else jnp.minimum(state.time, self.lag + 1)
        # (N / (N - 1))^G; infinite for N = 1, which has no variance estimate.
        rate = -jnp.log1p(-1.0 / num_particles)
        if state.selections is None:
            growth = jnp.exp(rate * looked_back * selections)
        else:
            growth = jnp.exp(rate * jnp.sum(state.selections))
        growth = growth.astype(weights.dtype)

        num_ancestors = jax.vmap(lambda family: _count(family, weights))(oldest)
        num_ancestors = jnp.broadcast_to(num_ancestors, (self.num_partitions,))
        unknown = (num_ancestors < np.sqrt(num_particles)) | (num_particles == 1)
        estimate_variance = growth * of_values
        evidence_variance = 1 - growth * (1 - of_weights)
        # A negative value is a noisy estimate of a small variance.
        is_told = ~unknown[0] & (looked_back == state.time) & (evidence_variance > 0)
        is_multinomial = getattr(tracker.resampling, "name", "") == "multinomial"
        is_told &= is_multinomial & ~tracker.ordering.exchanges
        return ErrorBars(
            **{field.name: getattr(summary, field.name) for field in dataclasses.fields(summary)},
            estimate_variance=jnp.where(unknown[:, None], jnp.nan, estimate_variance),
            evidence_variance=jnp.where(is_told, evidence_variance, jnp.nan),
            num_ancestors=num_ancestors,
            unknown=unknown,
        )


def _count(family: jax.Array, weights: jax.Array) -> jax.Array:
    """Number of families ``[N]`` that contain a particle of nonzero weight."""
    present = jnp.zeros(family.shape, bool).at[family].max(weights > 0)
    return jnp.sum(present, dtype=jnp.int32)
