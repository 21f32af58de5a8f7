"""Exchange of parts between particles that share the parent's draw (SPS).

Given its parent's draw, a part is independent of everything except its descendants.  Particles
with the same draw of the parent may therefore exchange the part, together with its past and its
descendants (gonzales2011, section 3).

A rule works in two steps around the resampling of a level.  For each part of the level, ``weigh``
returns the factor of each particle's weight, and ``draw`` then chooses the particle from which each
resampled slot takes the part.  The candidates are always the particles *before* resampling:
drawing again from the resampled set is biased.

The combinatorial rule sorts nothing: drawing a part lays out the slots group by group, and these
are the groups for its children.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import DTypeLike

from jaxpf.lowering.derivatives import weighted, with_gradient_of
from jaxpf.lowering.integers import EXACT, modulo, order_by_group
from jaxpf.lowering.prefix import held, running_max, running_sum
from jaxpf.ordering import SWAPS
from jaxpf.resampling.components import component_cdf, one_component
from jaxpf.resampling.schemes import ancestors_of_thresholds

# Codes of ordering.SWAPS.
_SORTED, _COMBINATORIAL = SWAPS.index("sorted"), SWAPS.index("combinatorial")

#: Multiplier from the golden ratio: its multiples spread evenly over the 32-bit integers.
_GOLDEN = np.uint32(0x9E3779B9)


class Groups(NamedTuple):
    """A division of the particles into contiguous groups of positions.

    Every entry is int32 ``[N]``, or ``[rows, N]`` for several divisions.

    Attributes:
        order: the particle at each position.
        position: the position of each particle.
        rank: by position, the rank within the group, 0 for its first member.
        last: by position, the position of the group's last member.
    """

    order: jax.Array
    position: jax.Array
    rank: jax.Array
    last: jax.Array

    def row(self, index: jax.Array) -> "Groups":
        """Return one of several divisions."""
        return Groups(*(rows[index] for rows in self))

    def put(self, index: jax.Array, row: "Groups") -> "Groups":
        """Replace one of several divisions."""
        return Groups(*(rows.at[index].set(new) for rows, new in zip(self, row, strict=True)))


def everyone(num_rows: int, num_particles: int) -> Groups:
    """``num_rows`` divisions, each into one group of all particles."""
    slots = jnp.broadcast_to(jnp.arange(num_particles, dtype=jnp.int32), (num_rows, num_particles))
    return Groups(slots, slots, slots, jnp.full_like(slots, num_particles - 1))


class Families(NamedTuple):
    """The slots after resampling, with the slots of each ancestor contiguous.

    Attributes:
        ancestors: ``[N]`` int32, non-decreasing.
        size: by ancestor, ``[N]`` int32, number of its slots.
        start: by ancestor, ``[N]`` int32, its first slot.
    """

    ancestors: jax.Array
    size: jax.Array
    start: jax.Array

    def groups(self) -> Groups:
        """Groups of slots with the same ancestor."""
        slots = jnp.arange(self.ancestors.shape[0], dtype=jnp.int32)
        start = self.start[self.ancestors]
        return Groups(slots, slots, slots - start, start + self.size[self.ancestors] - 1)


def families(ancestors: jax.Array) -> Families:
    """Sort ancestors ``[N]``.

    Sorting renumbers slots, which is valid for equal weights; otherwise ancestors must already be
    sorted.
    """
    size = jnp.zeros(ancestors.shape, jnp.int32).at[ancestors].add(1)
    end = running_sum(size)
    return Families(ancestors_of_thresholds(end), size, end - size)


class Offer(NamedTuple):
    """Data for one part from ``weigh`` to ``draw``; every entry is ``[N]``.

    Attributes:
        share: for the combinatorial rule, by position in the parent's groups, the running sum of
            the likelihoods as a share of the group's total.
        giver: for the permuting rules, the particle whose part each particle receives.
    """

    share: jax.Array
    giver: jax.Array


def no_offers(shape: tuple[int, ...], dtype: DTypeLike) -> Offer:
    """Allocate the offers of several parts, every entry of the given shape."""
    return Offer(jnp.zeros(shape, dtype), jnp.zeros(shape, jnp.int32))


def weigh(
    key: jax.Array,
    swap: jax.Array,
    log_probs: jax.Array,
    groups: Groups,
    lineage: jax.Array,
    is_root: jax.Array,
) -> tuple[jax.Array, Offer]:
    """For one part, return the log factor of each particle's weight ``[N]``, and its offer.

    Args:
        key: used only by the random rule.
        swap: ``[]`` int32, index into ``ordering.SWAPS``.
        log_probs: ``[N]``, log of the part's weight factor in each particle.
        groups: particles that may exchange the part, for the combinatorial rule.
        lineage: for the other rules, ``[N]`` int32 in 0..N-1, equal for particles that may
            exchange the part.
        is_root: ``[]`` bool, whether all particles may exchange the part.
    """
    slots = jnp.arange(log_probs.shape[0], dtype=jnp.int32)

    def permuted():
        giver = _permutation(key, swap, log_probs, lineage)
        return log_probs[giver], Offer(jnp.zeros_like(log_probs), giver)

    def resampled(weighed):
        factor, share = weighed
        return factor, Offer(share, slots)

    return lax.switch(
        _rule(swap, is_root),
        [
            permuted,
            lambda: resampled(_weigh_all(log_probs)),
            lambda: resampled(_weigh_groups(log_probs, groups)),
        ],
    )


def draw(
    key: jax.Array,
    swap: jax.Array,
    offer: Offer,
    groups: Groups,
    slots: Families,
    is_root: jax.Array,
) -> tuple[jax.Array, Groups]:
    """Return the particle from which each slot takes the part ``[N]``, and groups by shared draw.

    The combinatorial rule draws within the ancestor's group with probability proportional to the
    likelihood, independently of the slot's other parts (Dubuisson, Gonzales & Nguyen 2012,
    combinatorial resampling).
    """
    return lax.switch(
        _rule(swap, is_root),
        [
            # The permuting rules find groups from the lineage.
            lambda: (offer.giver[slots.ancestors], groups),
            lambda: _draw_from_all(key, offer.share),
            lambda: _draw_from_groups(key, offer.share, groups, slots),
        ],
    )


def _rule(swap: jax.Array, is_root: jax.Array) -> jax.Array:
    return jnp.where(swap == _COMBINATORIAL, jnp.where(is_root, 1, 2), 0)


def _weigh_all(log_probs: jax.Array) -> tuple[jax.Array, jax.Array]:
    """``_weigh_groups`` for one group of all particles in their order."""
    cdf = component_cdf(log_probs, one_component(log_probs.shape[0]))
    cumulative = held(cdf.cumulative, cdf.weights)
    return jnp.broadcast_to(cdf.log_mean, log_probs.shape), _share(cumulative, cumulative[-1])


def _draw_from_all(key: jax.Array, share: jax.Array) -> tuple[jax.Array, Groups]:
    """``_draw_from_groups`` for one group of all particles in their order."""
    numbers = jnp.arange(share.shape[0], dtype=jnp.int32)
    start, room = jnp.zeros((), jnp.int32), jnp.int32(share.shape[0])
    return _deal(key, share, start, room, numbers, start, room)


def _weigh_groups(log_probs: jax.Array, groups: Groups) -> tuple[jax.Array, jax.Array]:
    """Log of the group's mean likelihood per particle, and ``Offer.share``."""
    differentiated = log_probs
    log_probs = lax.stop_gradient(log_probs)[groups.order]
    largest = running_max(log_probs, groups.rank)[groups.last]
    possible = ~jnp.isneginf(largest)
    likelihood = jnp.exp(jnp.where(possible, log_probs - jnp.where(possible, largest, 0.0), 0.0))
    cumulative = running_sum(likelihood, groups.rank)
    total = cumulative[groups.last]
    positions = jnp.arange(log_probs.shape[0], dtype=jnp.int32)
    size = (groups.last - positions + groups.rank + 1).astype(total.dtype)
    log_mean = jnp.where(possible, largest + jnp.log(total / size), -jnp.inf)
    log_factor = log_mean[groups.position]
    # The rest only serves the derivative.
    part = jnp.where(possible, likelihood / total, 0.0)[groups.position]
    terms = weighted(part, differentiated)
    group = groups.last[groups.position]
    of_group = jnp.zeros_like(terms).at[group].add(terms)[group]
    return with_gradient_of(log_factor, of_group), _share(cumulative, total)


def _share(cumulative: jax.Array, total: jax.Array) -> jax.Array:
    """The quotient, exactly 1 at the end, where an accelerator's division may be inexact."""
    return jnp.where(cumulative < total, cumulative / total, 1.0)


def _draw_from_groups(
    key: jax.Array, share: jax.Array, groups: Groups, slots: Families
) -> tuple[jax.Array, Groups]:
    """Draw within each group for the slots whose ancestor belongs to it."""
    numbers = jnp.arange(share.shape[0], dtype=jnp.int32)
    # In the new layout a group's segment has one place for each of these slots.
    size = slots.size[groups.order]
    before = running_sum(size) - size
    start = before[numbers - groups.rank]
    room = (before + size)[groups.last] - start
    where = groups.position[slots.ancestors]
    place = numbers - slots.start[slots.ancestors] + (before - start)[where]
    taker, shared = _deal(key, share, start, room, place, start[where], room[where])
    return groups.order[taker], shared


def _deal(
    key: jax.Array,
    share: jax.Array,
    start: jax.Array,
    room: jax.Array,
    place: jax.Array,
    start_of_slot: jax.Array,
    room_of_slot: jax.Array,
) -> tuple[jax.Array, Groups]:
    """Systematic draws within each group, assigned to its slots by an affine permutation.

    Each slot's draw has the correct distribution (up to the 24 bits of a random number).  The
    permutation's offset is uniform, so the draw is independent of the slot's other parts, which
    suffices for unbiasedness.  The random stride keeps neighbouring slots from getting neighbouring
    draws.

    Args:
        key: random key of these draws.
        share: see ``Offer``.
        start: by position, the first place of the group's segment in the new layout.
        room: by position, the number of places in the segment.
        place: by slot, ``[N]`` int32, its index among the group's slots.
        start_of_slot: ``start`` of the slot's group.
        room_of_slot: ``room`` of the slot's group.

    Returns:
        By slot, the position of the member whose part it takes; and groups of slots that take the
        same member.
    """
    # Draw three words at once: splitting a key costs as much as four gathers.
    shift, offset, choice = jax.random.bits(key, (3,), jnp.uint32)
    numbers = jnp.arange(share.shape[0], dtype=jnp.int32)
    # A member takes one place per offspring.  The count must be complete at the end of the
    # likelihoods despite rounding.
    shift = (shift >> 8).astype(share.dtype) / EXACT
    wanted = jnp.ceil(share * room.astype(share.dtype) - shift).astype(jnp.int32)
    end = start + jnp.where(share < 1, jnp.clip(wanted, 0, room), room)
    # Segments are contiguous: a group's first member begins where the previous group ends.
    begin = jnp.concatenate([jnp.zeros((1,), jnp.int32), end[:-1]])
    taker = ancestors_of_thresholds(end)

    # One random number for all groups; multiples of the golden ratio decorrelate them.
    offset = offset + start_of_slot.astype(jnp.uint32) * _GOLDEN
    offset = (offset >> 8).astype(jnp.float32) / EXACT * room_of_slot
    strides = _strides(share.shape[0])
    stride = strides[choice % strides.shape[0]]
    stride = jnp.where(modulo(room_of_slot, stride) == 0, 1, stride)
    place = modulo(place * stride + offset.astype(jnp.int32), room_of_slot)

    position = start_of_slot + place
    return taker[position], Groups(
        order=jnp.zeros_like(numbers).at[position].set(numbers, unique_indices=True),
        position=position,
        rank=numbers - begin[taker],
        last=end[taker] - 1,
    )


def _strides(num_particles: int) -> jax.Array:
    """Primes that are small enough for ``modulo`` and, if possible, larger than any group."""
    largest = min(max(EXACT // num_particles - 1, 2), 2**16)
    sieve = np.ones(largest, bool)
    sieve[: min(2, largest)] = False
    for number in range(2, int(largest**0.5) + 1):
        sieve[number * number :: number] = False
    primes = np.flatnonzero(sieve)
    if (primes > num_particles).any():
        primes = primes[primes > num_particles]
    elif len(primes) == 0:
        primes = np.array([1])
    chosen = primes[np.linspace(0, len(primes) - 1, 512).astype(int)]
    return jnp.asarray(chosen, jnp.int32)


def _permutation(
    key: jax.Array, swap: jax.Array, log_probs: jax.Array, group: jax.Array
) -> jax.Array:
    """Givers ``[N]``: a group's k-th particle receives the group's k-th best (or a random) part."""
    num_particles = log_probs.shape[0]
    identity = jnp.arange(num_particles, dtype=jnp.int32)
    by_chance = jax.random.uniform(key, log_probs.shape, log_probs.dtype)
    merit = jnp.where(swap == _SORTED, -lax.stop_gradient(log_probs), by_chance)
    _, _, givers = lax.sort((group, merit, identity), num_keys=2, is_stable=True)
    receivers = order_by_group(group)
    return jnp.zeros((num_particles,), jnp.int32).at[receivers].set(givers)
