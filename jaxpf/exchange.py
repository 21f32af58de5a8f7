"""Exchanging parts between particles that share the parent's draw (SPS).

Given the draw of its parent, a part is independent of everything that does not hang from
it, so particles with the same lineage id of the parent may trade the part, together with
its past and all that hangs from it (gonzales2011, section 3).

A rule works in two steps around the resampling of a level.  ``weigh`` gives, for every
part of the level, the factor that multiplies each particle's weight; ``draw`` then gives
the particle from which each resampled slot takes the part.  The candidates are always the
particles *before* resampling: drawing again from the resampled set is biased.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.gradients import weighted, with_gradient_of
from jaxpf.prefix import running_sum, segment_starts
from jaxpf.resampling import below, component_cdf, inverse_cdf, one_component, systematic

# Codes of ordering.SWAPS.
_NONE, _RANDOM, _SORTED, _COMBINATORIAL = range(4)


class Offer(NamedTuple):
    """What ``weigh`` hands to ``draw`` for one part, every entry ``[N]``.

    Attributes:
        members: particles ordered by group; for the permuting rules, the particle whose
            part each particle receives.
        cumulative: within the group, running sum of the likelihoods in ``members`` order.
        group: the particle's group.
        end: by group, the position in ``members`` behind its last particle.
        size: by group, number of particles.
    """

    members: jax.Array
    cumulative: jax.Array
    group: jax.Array
    end: jax.Array
    size: jax.Array


def no_offers(shape: tuple[int, ...], dtype: Any) -> Offer:
    """Room for the offers of several parts, every entry of the given shape."""
    floats, ints = jnp.zeros(shape, dtype), jnp.zeros(shape, jnp.int32)
    return Offer(ints, floats, ints, ints, ints)


def weigh(
    key: jax.Array, swap: jax.Array, log_probs: jax.Array, group: jax.Array, is_root: jax.Array
) -> tuple[jax.Array, Offer]:
    """Log of each particle's factor of its weight, ``[N]``, and the candidates, for one part.

    Args:
        key: used by the random rule only.
        swap: ``[]`` int32, index into ``ordering.SWAPS``.
        log_probs: ``[N]``, the part's log-likelihood in each particle.
        group: ``[N]`` int32 in 0..N-1, particles that may trade the part.
        is_root: ``[]`` bool, all particles form one group.
    """
    combinatorial = jnp.where(is_root, 1, 2)
    return lax.switch(
        jnp.where(swap == _COMBINATORIAL, combinatorial, 0),
        [
            lambda: _weigh_permutation(key, swap, log_probs, group),
            lambda: _weigh_all(log_probs),
            lambda: _weigh_groups(log_probs, group),
        ],
    )


def draw(
    key: jax.Array, swap: jax.Array, offer: Offer, ancestors: jax.Array, is_root: jax.Array
) -> jax.Array:
    """``[N]``: the particle from which each slot, of the given ancestor, takes the part.

    The combinatorial rule draws within the ancestor's group with probability proportional
    to the likelihood, independently of the slot's other parts (Dubuisson, Gonzales &
    Nguyen 2012, combinatorial resampling).
    """
    combinatorial = jnp.where(is_root, 1, 2)
    return lax.switch(
        jnp.where(swap == _COMBINATORIAL, combinatorial, 0),
        [
            lambda: offer.members[ancestors],
            lambda: _draw_from_all(key, offer),
            lambda: _draw_from_groups(key, offer, ancestors),
        ],
    )


def _weigh_all(log_probs):
    """One group of all particles."""
    num_particles = log_probs.shape[0]
    cdf = component_cdf(log_probs, one_component(num_particles))
    slots = jnp.arange(num_particles, dtype=jnp.int32)
    log_factor = jnp.broadcast_to(cdf.log_mean, log_probs.shape)
    return log_factor, Offer(slots, cdf.cumulative, slots, slots, slots)


def _draw_from_all(key, offer):
    """Systematic draws, dealt out to the slots by a random affine permutation.

    Each slot's draw has the right law and, because the permutation's offset is uniform, is
    independent of the slot's other parts; that is all that unbiasedness needs.  The random
    stride keeps neighbouring slots from sharing neighbouring draws of several parts, and
    costs nothing next to the sort behind a uniform permutation.
    """
    num_particles = offer.cumulative.shape[0]
    systematic_key, stride_key, offset_key = jax.random.split(key, 3)
    drawn = systematic(systematic_key, offer.cumulative, one_component(num_particles))
    strides = _coprime_strides(num_particles)
    stride = strides[jax.random.randint(stride_key, (), 0, strides.shape[0])]
    offset = jax.random.randint(offset_key, (), 0, num_particles).astype(jnp.uint32)
    slots = jnp.arange(num_particles, dtype=jnp.uint32)
    return drawn[((slots * stride + offset) % num_particles).astype(jnp.int32)]


def _coprime_strides(num_particles: int) -> jax.Array:
    """Strides that visit all slots before repeating one; small enough not to overflow."""
    largest = min(num_particles, (2**32 - num_particles) // num_particles)
    candidates = np.unique(np.linspace(1, max(largest - 1, 1), 2048).astype(np.int64))
    coprime = candidates[np.gcd(candidates, num_particles) == 1]
    return jnp.asarray(coprime, jnp.uint32)


def _weigh_groups(log_probs, group):
    """Groups of any size, in any order: one integer sort brings them together."""
    differentiated, log_probs = log_probs, lax.stop_gradient(log_probs)
    none = jnp.zeros(log_probs.shape, jnp.int32)
    size = none.at[group].add(1)
    largest = jnp.full_like(log_probs, -jnp.inf).at[group].max(log_probs)
    possible = ~jnp.isneginf(largest)
    reference = jnp.where(possible, largest, 0.0)[group]
    likelihood = jnp.exp(log_probs - reference)
    members = order_by_group(group)
    grouped = group[members]
    cumulative = running_sum(likelihood[members], segment_starts(grouped))
    end = none.at[grouped].max(jnp.arange(1, 1 + none.shape[0], dtype=jnp.int32))
    mean = cumulative[end - 1] / jnp.maximum(size, 1).astype(likelihood.dtype)
    log_mean = jnp.where(possible, largest + jnp.log(jnp.where(possible, mean, 1.0)), -jnp.inf)
    log_factor = log_mean[group]
    alive = ~jnp.isneginf(log_probs)
    share = jnp.exp(jnp.where(alive, log_probs - jnp.where(alive, log_factor, 0.0), -jnp.inf))
    terms = weighted(share / size[group].astype(share.dtype), differentiated)
    of_group = jnp.zeros_like(share).at[group].add(terms)[group]
    return with_gradient_of(log_factor, of_group), Offer(members, cumulative, group, end, size)


def _draw_from_groups(key, offer, ancestors):
    """Independent draws by each slot within its ancestor's group."""
    group = offer.group[ancestors]
    end, size = offer.end[group], offer.size[group]
    total = offer.cumulative[end - 1]
    uniform = jax.random.uniform(key, total.shape, total.dtype)
    position = inverse_cdf(offer.cumulative, below(total, uniform), end - size, size)
    return offer.members[position]


def _weigh_permutation(key, swap, log_probs, group):
    num_particles = log_probs.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    by_chance = jax.random.uniform(key, log_probs.shape, log_probs.dtype)
    merit = jnp.where(swap == _SORTED, -lax.stop_gradient(log_probs), by_chance)
    # The k-th particle of a group, by index, receives the group's k-th best (or random) part.
    _, _, givers = lax.sort((group, merit, identity), num_keys=2, is_stable=True)
    receivers = order_by_group(group)
    source = jnp.zeros((num_particles,), jnp.int32).at[receivers].set(givers)
    zeros = jnp.zeros_like(log_probs)
    return log_probs[source], Offer(source, zeros, identity, identity, identity)


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
