"""What the stages of a frame carry from one to the next."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.filters.partitioned.exchange import Groups, Offer
from jaxpf.lowering.columns import pick_in_rows
from jaxpf.resampling.components import Components, component_max


class Carry(NamedTuple):
    """What the stages of a frame carry.  Rows are stages, not partitions.

    Attributes:
        stages: ``[2, D, P, N]``, substates drawn at each stage, and the ones they left.
        log_probs: ``[P, N]``, log-likelihood of each draw, by slot of drawing.
        lineage: ``[P, N]`` int32, see ``jaxpf.filters.partitioned.kernel``.
        log_weights: ``[N]``, unnormalised: their sum carries the evidence.
        seen: ``[P, C]`` bool, at that stage some particle of the component that had weight
            had likelihood too.
        largest: ``[C]``, the largest log-weight of each component.
        impossible: ``[N]`` bool, the particle's component met a stage at which no particle
            of it had any likelihood; the stage was left out of ``log_weights``.
        equal: ``[]`` bool, weights were equal after the last resampling.
        num_invalid: ``[]`` int32.
        label: ``[N]`` int32, of each particle; its component where particles carry no labels.
        path_scores: ``[P, N]``, by slot of drawing, see ``ParticleState``; or None.
        sources: ``[P, N]`` int32, by slot of drawing, see ``ParticleState``; or None.
        offers: every entry ``[P, N]``, what each part of the level offers for exchange; None
            where nothing is ever exchanged.
        groups: every entry ``[P, N]``, who shares the draw of each stage once its level has
            ended, for the combinatorial rule; None like ``offers``.
    """

    stages: jax.Array
    log_probs: jax.Array
    lineage: jax.Array
    log_weights: jax.Array
    seen: jax.Array
    largest: jax.Array
    impossible: jax.Array
    equal: jax.Array
    num_invalid: jax.Array
    label: jax.Array
    path_scores: jax.Array | None
    sources: jax.Array | None
    offers: Offer | None
    groups: Groups | None

    def lineage_of(self, particles: jax.Array) -> jax.Array:
        """Lineage ``[P, N]`` of the given particles, ``[N]`` or by row ``[P, N]``."""
        return pick_in_rows(self.lineage, particles)

    def write(self, stage: jax.Array, **rows: jax.Array) -> "Carry":
        """Replace a stage's row of the named entries, wherever that stands in them."""
        return self._replace(
            **{
                name: lax.dynamic_update_index_in_dim(
                    getattr(self, name), row, stage, axis=2 if name == "stages" else 0
                )
                for name, row in rows.items()
            }
        )

    def absorb(
        self, log_factor: jax.Array, components: Components, stage: jax.Array | None = None
    ) -> "Carry":
        """Multiply the weights by a factor, unless it is zero for a whole component.

        A component without any likelihood is marked impossible.  Its weights are left as they
        were, for the case that all components end so: then the frame's impossible observation
        is left out, instead of every weight being lost.
        """
        if self.path_scores is not None:
            log_factor = lax.stop_gradient(log_factor)  # the scores hold its derivative
        log_weights = self.log_weights + log_factor
        largest = component_max(log_weights, components)
        seen = ~jnp.isneginf(largest)
        possible = components.spread(seen)
        return self._replace(
            seen=self.seen if stage is None else self.seen.at[stage].set(seen),
            log_weights=jnp.where(possible, log_weights, self.log_weights),
            largest=jnp.where(seen, largest, self.largest),
            impossible=self.impossible | ~possible,
        )
