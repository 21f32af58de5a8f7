"""Exchanging parts between particles that share the parent's draw (SPS).

Given the draw of its parent, a part is independent of everything that does not hang from
it, so particles with the same lineage id of the parent may trade the part, together with
its past and all that hangs from it (gonzales2011, section 3).

A rule works in two steps around the resampling of a level.  ``weigh`` gives, for every
part of the level, the factor that multiplies each particle's weight; ``draw`` then gives
the particle from which each resampled slot takes the part.  The candidates are always the
particles *before* resampling: drawing again from the resampled set is biased.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.prefix import running_max, running_sum, segment_starts
from jaxpf.resampling import below, inverse_cdf

# Codes of ordering.SWAPS.
_NONE, _RANDOM, _SORTED, _COMBINATORIAL = range(4)


class Exchange(NamedTuple):
    """What ``weigh`` hands to ``draw`` for one part, every entry ``[N]``.

    Attributes:
        log_factor: what each particle's weight is multiplied by.
        members: particles ordered by group; for the permuting rules, the particle whose
            part each particle receives.
        cumulative: within the group, running sum of the likelihoods in ``members`` order.
        total: the sum over the particle's group.
        start: position in ``members`` where the particle's group begins.
        size: number of particles in its group.
    """

    log_factor: jax.Array
    members: jax.Array
    cumulative: jax.Array
    total: jax.Array
    start: jax.Array
    size: jax.Array


def weigh(
    key: jax.Array, swap: jax.Array, log_probs: jax.Array, group: jax.Array, is_root: jax.Array
) -> Exchange:
    """Factors and candidates of one part.

    Args:
        key: used by the random rule only.
        swap: ``[]`` int32, index into ``ordering.SWAPS``.
        log_probs: ``[N]``, the part's log-likelihood in each particle.
        group: ``[N]`` int32 in 0..N-1, particles that may trade the part.
        is_root: ``[]`` bool, all particles form one group (saves the sort).
    """
    return lax.cond(
        swap == _COMBINATORIAL,
        lambda: _weigh_combinatorial(log_probs, group, is_root),
        lambda: _weigh_permutation(key, swap, log_probs, group),
    )


def draw(key: jax.Array, swap: jax.Array, exchange: Exchange, ancestors: jax.Array) -> jax.Array:
    """``[N]``: the particle from which each slot, of the given ancestor, takes the part.

    The combinatorial rule draws within the ancestor's group with probability proportional
    to the likelihood, independently for every slot and part (Dubuisson, Gonzales & Nguyen
    2012, combinatorial resampling).
    """

    def combinatorial():
        total = exchange.total[ancestors]
        uniform = jax.random.uniform(key, total.shape, total.dtype)
        position = inverse_cdf(
            exchange.cumulative,
            below(total, uniform),
            exchange.start[ancestors],
            exchange.size[ancestors],
        )
        return exchange.members[position]

    return lax.cond(swap == _COMBINATORIAL, combinatorial, lambda: exchange.members[ancestors])


def _weigh_combinatorial(log_probs, group, is_root):
    num_particles = log_probs.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    members = lax.cond(is_root, lambda: identity, lambda: order_by_group(group))
    grouped = group[members]
    sizes = jnp.zeros((num_particles,), jnp.int32).at[group].add(1)
    ends = running_sum(sizes)
    start, end = (ends - sizes)[group], ends[group]
    ordered = log_probs[members]
    first = segment_starts(grouped)
    largest = running_max(ordered, first)[ends[grouped] - 1]
    possible = ~jnp.isneginf(largest)
    scaled = jnp.exp(jnp.where(possible, ordered - jnp.where(possible, largest, 0.0), 0.0))
    cumulative = running_sum(scaled, first)
    total = cumulative[end - 1]
    largest_of_group = largest[end - 1]
    size = end - start
    log_factor = jnp.where(
        jnp.isneginf(largest_of_group),
        -jnp.inf,
        largest_of_group + jnp.log(total) - jnp.log(size.astype(total.dtype)),
    )
    return Exchange(log_factor, members, cumulative, total, start, size)


def _weigh_permutation(key, swap, log_probs, group):
    num_particles = log_probs.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    by_chance = jax.random.uniform(key, log_probs.shape, log_probs.dtype)
    merit = jnp.where(swap == _SORTED, -log_probs, by_chance)
    # The k-th particle of a group, by index, receives the group's k-th best (or random) part.
    _, _, givers = lax.sort((group, merit, identity), num_keys=2, is_stable=True)
    receivers = order_by_group(group)
    source = jnp.zeros((num_particles,), jnp.int32).at[receivers].set(givers)
    zeros = jnp.zeros_like(log_probs)
    return Exchange(log_probs[source], source, zeros, zeros, identity, identity)


def order_by_group(group: jax.Array) -> jax.Array:
    """``[N]`` int32: particles in order of their group ``[N]`` (0..N-1), stably."""
    num_particles = group.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    if num_particles <= 2**16:
        # One integer key holds group and index: a plain sort, several times faster than
        # one that carries a second operand.
        key = group.astype(jnp.uint32) * jnp.uint32(num_particles) + identity.astype(jnp.uint32)
        return (lax.sort(key) % jnp.uint32(num_particles)).astype(jnp.int32)
    return lax.sort((group, identity), num_keys=1, is_stable=True)[1]
