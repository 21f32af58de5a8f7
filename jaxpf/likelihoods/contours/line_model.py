"""Likelihood of a measurement line given the boundaries that cross it: ``p_c`` of maccormick1999.

A line of length L shows n features.  Boundaries at ``nu_1 .. nu_c`` cross it.  With probability
``q_kc`` k of them are detected, and all sets of k are equally likely.  A detected boundary produces
one feature with density G: normal about ``nu``, renormalised on the line.  The other n - k features
are clutter: their number has distribution b, and their places are uniform.  **No feature serves two
boundaries**: this is the exclusion principle.

Everything is relative to pure clutter, ``p~_c / p_0``, because lines move with the hypothesis, so
densities of different hypotheses would describe different data.

A line keeps at most the n_max strongest features, so n_max features mean "n_max or more".  The
features of detected boundaries are assumed to be kept, and the kept clutter to be a random subset.
Then a line has a density for every n from 0 to n_max, and these sum to one without a truncated
tail.
"""

import math
from collections.abc import Sequence
from math import comb

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import ndtr

from jaxpf.likelihoods.contours.edges import Features

#: ``q_kc`` of maccormick1999, section 2.
ONE_BOUNDARY = (0.1, 0.9)
TWO_BOUNDARIES = (0.05, 0.2, 0.75)
#: Standard deviation of a boundary's feature in pixels, sigma of maccormick1999.
SIGMA = 7.0
#: Number of boundaries whose subsets are unrolled, which runs faster.  The subsets of further ones
#: are array axes, since unrolling them would take the compiler minutes.
_WRITTEN_OUT = 3


def detection_probabilities(most: int) -> np.ndarray:
    """``q_kc`` at ``[c, k]``, ``[most + 1, most + 1]``.

    The paper gives c = 1 and 2.  For more, the detection probability of a line is a Beta variable
    shared by its boundaries (beta-binomial), with parameters that reproduce the paper's c = 2.
    """
    table = np.zeros((most + 1, most + 1))
    table[0, 0] = 1.0
    for c, given in ((1, ONE_BOUNDARY), (2, TWO_BOUNDARIES)):
        if c <= most:
            table[c, : c + 1] = given
    missed, both_missed = TWO_BOUNDARIES[0] + TWO_BOUNDARIES[1] / 2, TWO_BOUNDARIES[0]
    # E[1 - p] = beta / (alpha + beta) and E[(1 - p)^2], solved for alpha + beta.
    total = (missed - both_missed) / (both_missed - missed**2)
    for c in range(3, most + 1):
        for k in range(c + 1):
            table[c, k] = comb(c, k) * _beta_moment(k, c - k, (1 - missed) * total, missed * total)
    return table


@jax.jit
def line_weights(clutter, detection, length: float) -> jax.Array:
    """Weights of the matchings of k boundaries, on a line with c boundaries and n features.

    ``q_kc / C(c, k) * L^k (n - k)! b(n - k) / (n! b(n))``, 0 where n < k.  At n = n_max the line
    may have shown more, so ``b(n - k)`` and ``b(n)`` are replaced by the probabilities of n - k or
    more and of n or more.

    Args:
        clutter: b(n) for n = 0 .. n_max, ``[n_max + 1]``, above 0; if it sums to less than one,
            the rest is the probability of n > n_max.
        detection: ``q_kc``, ``[c, k]``.
        length: L in pixels.

    Returns:
        ``[k, c, n]``.
    """
    clutter, detection = jnp.asarray(clutter), jnp.asarray(detection)
    most, counts = detection.shape[0] - 1, np.arange(clutter.shape[0])
    # Of more detected boundaries than n_max, a line shows a random subset of n_max.
    detection = detection.at[:, min(counts[-1], most)].add(
        jnp.sum(detection[:, counts[-1] + 1 :], axis=1)
    )
    or_more = jnp.cumsum(at_most_shown(clutter)[::-1])[::-1]
    rows = []
    for k in range(most + 1):
        falling = np.ones(len(counts))  # n (n - 1) .. (n - k + 1)
        for step in range(k):
            falling = falling * np.maximum(counts - step, 1)
        fewer = np.maximum(counts - k, 0)
        shares = clutter[fewer] / clutter
        shares = shares.at[-1].set(or_more[fewer[-1]] / or_more[-1])
        # As a float: a power of an integer number of pixels soon overflows 32 bits.
        ratio = jnp.where(counts >= k, (1.0 * length) ** k / falling * shares, 0.0)
        ways = np.array([max(comb(c, k), 1) for c in range(most + 1)])
        rows.append((detection[:, k] / ways)[:, None] * ratio)
    return jnp.stack(rows)


def at_most_shown(clutter) -> jax.Array:
    """b(n), with the probability of n_max or more at n_max, so that it sums to one."""
    clutter = jnp.asarray(clutter)
    return clutter.at[-1].add(jnp.maximum(1 - jnp.sum(clutter), 0))


def boundary_law(places, boundary, sigma, reach):
    """G: density of a boundary's feature at ``places``, renormalised on [-reach, reach]."""
    mass = ndtr((reach - boundary) / sigma) - ndtr((-reach - boundary) / sigma)
    scale = 1.0 / (sigma * math.sqrt(2 * math.pi) * jnp.maximum(mass, 1e-6))
    return scale * jnp.exp(-0.5 * ((places - boundary) / sigma) ** 2)


def matchings(laws) -> jax.Array:
    """Sum, for each set of boundaries, over all assignments of a distinct feature to each.

    A recursion over features: each serves none or one of the boundaries, and is added to the sums
    from *before* it.  An in-place update could let it serve two, which violates exclusion.

    Args:
        laws: ``G_j(z_f)`` at ``[c, F, ...]``, 0 where the boundary or feature does not exist.

    Returns:
        ``[2^c, ...]``: bit j of the first index says whether boundary j is in the set.
    """
    num_boundaries, shape = laws.shape[0], laws.shape[2:]
    unit = jnp.ones(shape, laws.dtype)
    if num_boundaries <= 1:
        return jnp.stack([unit, *jnp.sum(laws, axis=1)])

    written = min(num_boundaries, _WRITTEN_OUT)

    def serve(sums, law):
        """Add one feature; ``law`` is its ``G_j``, ``[c, ...]``."""
        # A block holds the sets with the same members among the unrolled boundaries.
        blocks, totals = [sums[number :: 2**written] for number in range(2**written)], []
        for number, block in enumerate(blocks):
            total = block
            for j in range(written):
                if number >> j & 1:
                    total = total + blocks[number ^ (1 << j)] * law[j]
            for j in range(written, num_boundaries):
                # The middle axis says whether boundary j is in the set.
                without = block.reshape(-1, 2, 2 ** (j - written), *shape)[:, 0]
                gained = jnp.stack([jnp.zeros_like(without), without * law[j]], axis=1)
                total = total + gained.reshape(block.shape)
            totals.append(total)
        return jnp.stack(totals, axis=1).reshape(sums.shape), None

    # A loop, not unrolled: the compiler would repeat every shared sum in each of its uses.
    begin = jnp.concatenate([unit[None], jnp.zeros((2**num_boundaries - 1, *shape), laws.dtype)])
    sums, _ = lax.scan(serve, begin, jnp.moveaxis(laws, 1, 0))
    return sums


def log_ratio(weights, features: Features, boundaries, crossing, sigma, reach):
    """Log of ``p~_c / p_0`` on lines; c may differ between lines.

    Args:
        weights: ``[k, c, n]`` from ``line_weights``.
        features: places and presence ``[F, ...]``, F at most n_max.
        boundaries: ``nu``, ``[C, ...]``, pixels from the line's middle.
        crossing: ``[C, ...]`` bool, whether the boundary exists.
        sigma: standard deviation of G, pixels.
        reach: L / 2.

    Returns:
        ``[...]``.
    """
    every = range(boundaries.shape[0])
    return log_ratios(weights, features, boundaries, crossing, sigma, reach, [every])[0]


def log_ratios(
    weights, features: Features, boundaries, crossing, sigma, reach, groups: Sequence[Sequence[int]]
) -> jax.Array:
    """``log_ratio`` for several subsets of the boundaries that cross each line, ``[groups, ...]``.

    The arguments are those of ``log_ratio``, and ``groups``: the rows of ``boundaries`` in each
    subset.
    """
    places, present = features
    dtype = places.dtype
    counted = jnp.sum(present, axis=0, dtype=jnp.int32)
    law = boundary_law(places[None], boundaries[:, None], sigma, reach)
    sums = matchings(jnp.where(present[None] & crossing[:, None], law, 0.0).astype(dtype))
    weights = jnp.asarray(weights, dtype)
    num_counts = weights.shape[2]
    table = weights.reshape(weights.shape[0], -1)
    rows, sets = np.arange(crossing.shape[0]), np.arange(len(sums))
    members = np.array([np.isin(rows, np.array(group, int)) for group in groups])
    # A set of boundaries lies within a group if it has no member outside the group.
    within = (~members @ (1 << rows))[:, None] & sets == 0
    sizes = np.array([int(s).bit_count() for s in sets])

    crossed = jnp.tensordot(members.astype(np.int32), crossing.astype(jnp.int32), 1)
    place = crossed * num_counts + counted
    ratio = jnp.zeros((), dtype)
    for k in range(max(map(len, groups)) + 1):
        chosen = within[:, sizes == k].astype(dtype)
        matched = jnp.tensordot(chosen, sums[sizes == k], 1, precision=lax.Precision.HIGHEST)
        ratio = ratio + table[k][place] * matched
    possible = ratio > 0
    return jnp.where(possible, jnp.log(jnp.where(possible, ratio, 1.0)), -jnp.inf)


def _beta_moment(successes: int, failures: int, alpha: float, beta: float) -> float:
    """``E[p^successes (1 - p)^failures]`` of a Beta variable."""
    moment = 1.0
    for k in range(successes):
        moment *= (alpha + k) / (alpha + beta + k)
    for k in range(failures):
        moment *= (beta + k) / (alpha + beta + successes + k)
    return moment
