"""The levels of simultaneous partitioned sampling inside a frame (gonzales2011).

Each stage of a level weights its part for the exchange.  The last stage resamples, and every slot
draws the level's parts again.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.calls import optional
from jaxpf.filters.partitioned import exchange
from jaxpf.filters.partitioned.carry import Carry
from jaxpf.lowering.threefry import key_at


def weigh_part(tracker, key, stage, carry, log_factor) -> tuple[jax.Array, exchange.Offer | None]:
    """Log of a stage's weight factors, ``[N]``, and the level's offers.

    Without exchange the factors are the part's ``log_factor``, ``[N]``.
    """
    ordering = tracker.ordering
    if carry.offers is None:
        return log_factor, None

    def weigh():
        parent, is_root = _parent_row(ordering, stage)
        groups, lineage = carry.groups.row(parent), jnp.where(is_root, 0, carry.lineage[parent])
        return exchange.weigh(key, ordering.swap, log_factor, groups, lineage, is_root)

    def keep():
        return log_factor, jax.tree.map(lambda rows: rows[stage], carry.offers)

    factor, offer = lax.cond(ordering.exchanged[stage], weigh, keep)
    if not _always_equal(tracker):
        factor = jnp.where(carry.equal, factor, log_factor)
    return factor, jax.tree.map(
        lambda rows, row: lax.dynamic_update_index_in_dim(rows, row, stage, axis=0),
        carry.offers,
        offer,
    )


def end(tracker, key, stage, resample, carry, offers) -> Carry:
    """End a level: resample, and draw the level's parts again for every slot."""
    ordering = tracker.ordering
    # Selecting from a row of identities yields each slot's ancestor.
    identity = jnp.arange(tracker.num_particles, dtype=jnp.int32)
    tagged = resample(carry._replace(lineage=identity[None], groups=None))
    slots = exchange.families(tagged.lineage[0])
    keys = jax.random.split(key, tracker.num_partitions)

    def kept():
        return slots.ancestors, slots.groups()

    def draw(row, drawn):
        givers, groups = drawn

        def anew():
            offer = jax.tree.map(lambda rows: rows[row], offers)
            parent, is_root = _parent_row(ordering, row)
            shared = groups.row(parent)
            return exchange.draw(key_at(keys, row), ordering.swap, offer, shared, slots, is_root)

        def anew_where_allowed():
            if _always_equal(tracker):
                return anew()
            return jax.tree.map(partial(jnp.where, carry.equal), anew(), kept())

        giver, group = lax.cond(ordering.exchanged[row], anew_where_allowed, kept)
        return givers.at[row].set(giver), groups.put(row, group)

    first = jnp.argmax(ordering.level == ordering.level[stage])
    drawn = jnp.broadcast_to(slots.ancestors, carry.lineage.shape), carry.groups
    givers, groups = lax.fori_loop(first, stage + 1, draw, drawn)
    # Descendants of this level's parts move with them; everything else stays with the ancestor.
    carrier = ordering.carrier[stage][:, None]
    source = jnp.where(carrier >= 0, givers[ordering.carrier[stage]], slots.ancestors)
    return tagged._replace(lineage=carry.lineage_of(source), groups=groups)


def _parent_row(ordering, stage) -> tuple[jax.Array, jax.Array]:
    """Stage of the parent of a stage's part, and whether the part is a root."""
    parent = ordering.tree[ordering.order[0, stage]]
    return ordering.rank[0, jnp.maximum(parent, 0)], parent < 0


def may_exchange(tracker) -> bool:
    """Whether exchange is possible: several partitions and a compatible gradient strategy.

    Exchange requires equal weights and a single ancestor per particle; blending gives none.
    """
    gradient = tracker.gradient
    return tracker.num_partitions > 1 and gradient.equalises and not gradient.blends


def _always_equal(tracker) -> bool:
    """Whether weights are equal at the start of every level because all resampling is by weight."""
    first_stage = optional(tracker.likelihood, "log_first_stage")
    return tracker.ess_threshold is None and first_stage is None
