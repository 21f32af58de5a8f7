"""Monte-Carlo error from one run: the genealogical variance estimator, and its fixed-lag form.

Two particles that descend from one draw share its luck.  So what another run would report differs
by how much of the answer hangs on single ancestors (Chan & Lai 2013; Lee & Whiteley 2018).  With
weights w, an answer ``sum_i w_i f_i``, and S_e the part of ``sum_i w_i (f_i - answer)`` that is
due to the descendants of ancestor e ::

    variance = (N / (N - 1))^G  sum_e S_e^2

over G generations of particles.  For the evidence f is 1 and nothing is subtracted; its relative
variance is ``1 - (N / (N - 1))^G (1 - sum_e S_e^2)``, without bias.

*The clock.*  A frame of partitioned sampling is as many generations as it has selections, so the
estimator holds on the clock of (frame, stage).  Grouped by the ancestor at each tick in turn, the
sums of squares fall from the last tick to the first; what each of them adds is the variance that
was made at that tick: by the partition whose turn it was.

*How far back.*  In long clips all particles soon descend from one ancestor, and the sum says
nothing more.  Ancestors a fixed number of frames back keep the estimate alive, at the price of what
is older (Olsson & Douc 2019).  Where fewer than sqrt(N) ancestors are left, the answer is NaN.  The
runs that still have enough are the lucky ones: where most runs give NaN, the others give too small
a variance (measured: .84 to .89 of the true one).

*Adaptive resampling.*  With ``ess_threshold`` G counts the selections that happen.

*What theory covers*: multinomial resampling at every selection, without exchange.  The rest is
measured: a single run's estimate over the variance of 1000 runs, N = 1000, four objects or a tree
of three parts, 5 frames, standard errors .05.  Estimates: systematic resampling .92 to 1.05, DPS
.88 to 1.08, SPS .90 to 1.13; looking ahead, of three objects that are seen jointly, .65 to .69, and
two of three runs did not know.  The evidence under systematic resampling .24 to .33, far too small:
what is subtracted is the chance of multinomial draws.  It is reported with those alone; otherwise
compare runs.  Where parts are exchanged, each partition has ancestors of its own, and the evidence
has no error bar.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete, pytree_dataclass, static_field
from jaxpf.contract.state import ParticleState, Summary
from jaxpf.filters.partitioned.tracker import Partitioned


@pytree_dataclass
class Ancestry:
    """A filter's state, and from whom its particles descend.

    Attributes:
        state: of the filter.
        families: ``[K, S, Q, N]`` int32, the slot in which the ancestor of each particle was drawn:
            k frames ago, at stage s; or at the start of the clip, with K and S 1.  Q is P where
            each partition has ancestors of its own, else 1.
        time: ``[]`` int32, frames so far.
        selections: ``[K]``, selections of each frame, the latest first, or with K = 1 of all
            frames; None where every selection happens.
    """

    state: ParticleState
    families: jax.Array
    time: jax.Array
    selections: jax.Array | None = None


@pytree_dataclass
class ErrorBars(Summary):
    """A ``Summary`` with the variance that its answers would have over many runs.

    Attributes:
        estimate_variance: ``[P, D]``, of ``estimate``; NaN where it is not known.
        evidence_variance: ``[]``, relative variance of the evidence of all frames so far, which
            is about the variance of its logarithm; NaN where it is not known, with a lag from the
            frame after it on, where parts are exchanged, and unless resampling is multinomial.
        num_ancestors: ``[P]`` int32, from how many each partition's draws descend.
        unknown: ``[P]`` bool, these were fewer than sqrt(N), and nothing can be said.
        estimate_terms: ``[S, P, D]``, what each stage of the frames looked back over adds to
            ``estimate_variance``; None unless asked for.
        evidence_terms: ``[S]``, the same of ``evidence_variance``, to first order.
    """

    estimate_variance: jax.Array | None = None
    evidence_variance: jax.Array | None = None
    num_ancestors: jax.Array | None = None
    unknown: jax.Array | None = None
    estimate_terms: jax.Array | None = None
    evidence_terms: jax.Array | None = None

    @property
    def estimate_error(self) -> jax.Array:
        """``[P, D]``, standard error of ``estimate``."""
        return jnp.sqrt(jnp.asarray(self.estimate_variance))


@pytree_dataclass
class WithErrorBars(contract.Tracker):
    """A filter that reports how much another run of it would differ; its answers are the same.

    Attributes:
        tracker: a ``jaxpf.Partitioned``.
        lag: static, how many frames to look back; None: to the start of the clip.
        stages: static, whether to report what each stage adds (``estimate_terms``,
            ``evidence_terms``); with ``lag`` alone.  Stage j is the turn of partition
            ``tracker.ordering.order[0, j]``.
        by_partition: static, whether each partition has its own ancestors; found from the ordering.

    Raises:
        InputError: another filter; transport, which has no ancestors; a lag below 0; stages without
            a lag, or where parts are exchanged.
    """

    tracker: Partitioned
    lag: int | None = static_field(default=None)
    stages: bool = static_field(default=False)
    by_partition: bool | None = static_field(default=None)

    def __post_init__(self):
        tracker = self.tracker
        if not isinstance(tracker, Partitioned):
            raise InputError(
                f"error bars from one run follow the ancestors of whole particles, which "
                f"{type(tracker).__name__} has not; use jaxpf.Partitioned, or compare many runs."
            )
        if tracker.gradient.blends:
            raise InputError(
                "Transport blends particles, which then have no ancestors; use another gradient."
            )
        if self.by_partition is None:
            exchanged = (
                is_concrete(tracker.ordering) and np.asarray(tracker.ordering.exchanged).any()
            )
            object.__setattr__(self, "by_partition", bool(exchanged))
        if self.lag is not None and self.lag < 0:
            raise InputError(f"lag={self.lag} must be at least 0; None looks back to the start.")
        if self.stages and (self.lag is None or self.by_partition):
            raise InputError(
                "stages=True needs a lag, such as the number of frames, and an ordering that "
                "exchanges no parts; give lag=..., or use stages=False."
            )
        if self.stages and tracker.ess_threshold is not None:
            raise InputError(
                "stages=True counts a selection after every stage, and ess_threshold="
                f"{tracker.ess_threshold} skips some; use ess_threshold=None or stages=False."
            )

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return self.tracker.num_partitions

    def init(self, key: jax.Array) -> Ancestry:
        """The filter's first state, in which everyone is an ancestor."""
        state = self.tracker.init(key)
        shape = (self.num_partitions, self.tracker.num_particles)
        rows = (
            1 if self.lag is None else self.lag + 1,
            shape[0] if self.stages else 1,
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
            time=jnp.zeros((), jnp.int32),
            selections=none_yet if adaptive else None,
        )

    def observe(self, frame: Any) -> Any:
        """What the filter needs of a frame."""
        return self.tracker.observe(frame)

    def step_observed(
        self, key: jax.Array, state: Ancestry, observation: Any
    ) -> tuple[Ancestry, ErrorBars]:
        """One frame of the filter, and whose children its particles are."""
        inner, summary = self.tracker.step_observed(key, state.state, observation)
        families = self._families(inner, state.families)
        selections = state.selections
        if selections is not None:
            kept = selections if self.lag is None else jnp.roll(selections, 1).at[0].set(0)
            selections = kept.at[0].add(inner.selections)
        state = Ancestry(inner, families, state.time + 1, selections)
        return state, self._report(state, summary)

    def _families(self, state: ParticleState, before: jax.Array) -> jax.Array:
        """``families`` one frame on."""
        ordering, sources = self.tracker.ordering, jnp.asarray(state.sources)
        num_rows = before.shape[2]
        # Without exchange all partitions of a particle come from one: that of the first stage.
        order = ordering.order[state.component]  # [N, P]
        particles = jnp.arange(sources.shape[1])
        by_stage = state.lineage[order.T, particles]  # [P, N]
        if not self.by_partition:
            sources = sources[order[:, 0], particles][None]
        handed_on = jnp.take_along_axis(before, sources[None, None], axis=-1)
        if self.lag is None:
            return handed_on
        own = state.lineage[None] if self.by_partition else by_stage[: before.shape[1], None]
        return jnp.concatenate([own.reshape(1, -1, num_rows, own.shape[-1]), handed_on[:-1]])

    def _report(self, state: Ancestry, summary: Summary) -> ErrorBars:
        tracker, families = self.tracker, state.families
        num_particles = tracker.num_particles
        weights = jnp.exp(state.state.log_weights)
        values = jnp.where(weights > 0, state.state.lagged[0], 0.0) - summary.estimate.T[..., None]
        parts = jnp.where(weights > 0, values, 0.0) * weights  # [D, P, N]

        def squares(of_one: jax.Array) -> tuple[jax.Array, jax.Array]:
            """Sums of squares ``[P, D]`` and ``[]`` over the families ``[Q, N]`` of one tick."""
            of_parts = jnp.broadcast_to(of_one, (self.num_partitions, num_particles))

            def of_partition(family: jax.Array, part: jax.Array) -> jax.Array:
                shares = jnp.zeros(part.shape, part.dtype).at[:, family].add(part)
                return jnp.sum(shares**2, axis=1)

            shares = jnp.zeros(weights.shape, weights.dtype).at[of_one[0]].add(weights)
            of_values = jax.vmap(of_partition, in_axes=(0, 1))(of_parts, parts)
            return of_values, jnp.sum(shares**2)

        ticks = families[::-1].reshape(-1, *families.shape[2:])  # from the oldest
        of_values, of_weights = lax.map(squares, ticks)

        selections = jnp.sum(tracker.ordering.resample_after, dtype=jnp.int32) + 1
        looked_back = state.time if self.lag is None else jnp.minimum(state.time, self.lag + 1)
        # (N / (N - 1))^G, infinite where N is 1 and nothing can be known.
        rate = -jnp.log1p(-1.0 / num_particles)
        if state.selections is None:
            growth = jnp.exp(rate * looked_back * selections)
        else:
            growth = jnp.exp(rate * jnp.sum(state.selections))
        growth = growth.astype(weights.dtype)

        num_ancestors = jax.vmap(lambda family: _count(family, weights))(ticks[0])
        num_ancestors = jnp.broadcast_to(num_ancestors, (self.num_partitions,))
        unknown = (num_ancestors < np.sqrt(num_particles)) | (num_particles == 1)
        estimate_variance = growth * of_values[0]
        evidence_variance = 1 - growth * (1 - of_weights[0])
        # A negative variance is an unlucky estimate of a small one.
        is_told = ~unknown[0] & (looked_back == state.time) & (evidence_variance > 0)
        is_multinomial = getattr(tracker.resampling, "name", "") == "multinomial"
        is_told &= is_multinomial and not self.by_partition
        terms: dict[str, Any] = {}
        if self.stages:
            terms = self._terms(of_values, of_weights, growth, state.time)
            terms["estimate_terms"] = jnp.where(unknown[:, None], jnp.nan, terms["estimate_terms"])
            terms["evidence_terms"] = jnp.where(is_told, terms["evidence_terms"], jnp.nan)
        return ErrorBars(
            **{field.name: getattr(summary, field.name) for field in dataclasses.fields(summary)},
            estimate_variance=jnp.where(unknown[:, None], jnp.nan, estimate_variance),
            evidence_variance=jnp.where(is_told, evidence_variance, jnp.nan),
            num_ancestors=num_ancestors,
            unknown=unknown,
            **terms,
        )

    def _terms(self, of_values, of_weights, growth, time) -> dict[str, Any]:
        """What every stage adds: how the sums of squares fall from one tick to the next."""
        num_stages = self.num_partitions
        selects = jnp.append(self.tracker.ordering.resample_after[:-1], True)
        # Frames before the first have no ticks of their own: their rows are all alike.
        num_frames = len(of_weights) // num_stages
        is_tick = np.repeat(np.arange(num_frames)[::-1], num_stages) < time

        def fall(sums: jax.Array) -> jax.Array:
            return sums - jnp.concatenate([sums[1:], jnp.zeros_like(sums[:1])])

        def by_stage(terms: jax.Array) -> jax.Array:
            return jnp.sum(terms.reshape(-1, num_stages, *terms.shape[1:]), axis=0)

        chance = jnp.tile(selects, num_frames) & is_tick
        return {
            "estimate_terms": growth * by_stage(fall(of_values)),
            "evidence_terms": by_stage(fall(of_weights) - chance / self.tracker.num_particles),
        }


def _count(family: jax.Array, weights: jax.Array) -> jax.Array:
    """Number of families ``[N]`` that have a member with weight."""
    present = jnp.zeros(family.shape, bool).at[family].max(weights > 0)
    return jnp.sum(present, dtype=jnp.int32)
