"""What a measurement line shows of the boundaries that cross it: ``p_c`` of maccormick1999.

A line of length L shows n features.  Boundaries at ``nu_1 .. nu_c`` cross it; k of them are
detected, with probability ``q_kc``, and any k of the c are as likely.  A detected boundary gives
one feature, of law G: normal about ``nu``, renormalised on the line.  The other n - k features are
clutter: their number has the law b, their places are uniform.  **No feature serves two
boundaries**, which is the exclusion principle.

Everything is told relative to pure clutter, ``p~_c / p_0``: lines move with the hypothesis, so
that densities of different hypotheses would speak of different data.
"""

from math import comb

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import ndtr

from jaxpf.errors import InputError
from jaxpf.models.likelihoods.contours.edges import Features

#: ``q_kc`` of maccormick1999, section 2.
ONE_BOUNDARY = (0.1, 0.9)
TWO_BOUNDARIES = (0.05, 0.2, 0.75)
#: Width of the law of a boundary's feature in pixels, sigma of maccormick1999.
SIGMA = 7.0


def detection_probabilities(most: int) -> np.ndarray:
    """``q_kc`` at ``[c, k]``, ``[most + 1, most + 1]``.

    The paper gives c = 1 and 2.  For more the detectability of a line is a Beta variable that its
    boundaries share, with the two numbers that give the paper's c = 2 exactly: beta-binomial.
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


def check_detection(table) -> np.ndarray:
    """Detection probabilities ``[c, k]``, as ``detection_probabilities`` gives them.

    Raises:
        InputError: not square, negative, or a row that does not sum to one.
    """
    table = np.asarray(table, float)
    square = table.ndim == 2 and table.shape[0] == table.shape[1] >= 2
    if not square or (table < 0).any() or not np.allclose(table.sum(axis=1), 1, atol=1e-6):
        raise InputError(
            f"detection {table.tolist()} must hold the probabilities that k of c boundaries are "
            "detected, one row for each c from 0 on, each summing to one."
        )
    return table


def line_weights(clutter, detection, length: float) -> jax.Array:
    """What multiplies the matchings of k boundaries on a line of c boundaries and n features.

    ``q_kc / C(c, k) * L^k (n - k)! b(n - k) / (n! b(n))``, 0 where n < k.

    Args:
        clutter: b(n) for n = 0 .. n_max, ``[n_max + 1]``, above 0.
        detection: ``q_kc``, ``[c, k]``.
        length: L in pixels.

    Returns:
        ``[k, c, n]``.
    """
    clutter, detection = jnp.asarray(clutter), jnp.asarray(detection)
    most, counts = detection.shape[0] - 1, np.arange(clutter.shape[0])
    rows = []
    for k in range(most + 1):
        falling = np.ones(len(counts))  # n (n - 1) .. (n - k + 1)
        for step in range(k):
            falling = falling * np.maximum(counts - step, 1)
        fewer = clutter[np.maximum(counts - k, 0)]
        ratio = jnp.where(counts >= k, length**k * fewer / (falling * clutter), 0.0)
        ways = np.array([max(comb(c, k), 1) for c in range(most + 1)])
        rows.append((detection[:, k] / ways)[:, None] * ratio)
    return jnp.stack(rows)


def boundary_law(places, boundary, sigma, reach):
    """G: density at ``places`` of the feature of a boundary, renormalised on [-reach, reach]."""
    mass = ndtr((reach - boundary) / sigma) - ndtr((-reach - boundary) / sigma)
    scale = 1.0 / (sigma * np.sqrt(2 * np.pi) * jnp.maximum(mass, 1e-6))
    return scale * jnp.exp(-0.5 * ((places - boundary) / sigma) ** 2)


def matchings(laws) -> list[jax.Array]:
    """Sums over the ways in which k boundaries have k features, for k = 0 .. c.

    The recursion over features: each serves none or one of the boundaries that are still free,
    always from the sums *before* it.  In place, it would serve two, and exclusion were lost.

    Args:
        laws: ``G_j(z_f)`` at ``[c, F, ...]``, 0 where there is no such boundary or feature.

    Returns:
        c + 1 arrays ``[...]``.
    """
    num_boundaries = laws.shape[0]
    one = jnp.ones_like(laws[0, 0]) if num_boundaries else jnp.ones(())
    if num_boundaries <= 1:
        return [one, *jnp.sum(laws, axis=1)]
    subsets = range(2**num_boundaries)

    def serve(sums, law):
        """One feature more: ``law`` is ``G_j`` of it, ``[c, ...]``."""
        found = [
            sum(
                (
                    sums[subset ^ (1 << j)] * law[j]
                    for j in range(num_boundaries)
                    if subset >> j & 1
                ),
                start=sums[subset],
            )
            for subset in subsets
        ]
        return jnp.stack(found), None

    # A loop, not written out: the compiler would repeat every shared sum in each of its uses.
    begin = jnp.stack([one, *[jnp.zeros_like(one)] * (2**num_boundaries - 1)])
    sums, _ = lax.scan(serve, begin, jnp.moveaxis(laws, 1, 0))
    return [
        sum(
            (sums[subset] for subset in subsets if subset.bit_count() == size),
            start=jnp.zeros_like(one),
        )
        for size in range(num_boundaries + 1)
    ]


def log_ratio(weights, features: Features, boundaries, crossing, sigma, reach):
    """Log of ``p~_c / p_0`` on lines, where c may differ from line to line.

    Args:
        weights: ``[k, c, n]`` from ``line_weights``.
        features: places and presence ``[F, ...]``, F at most n_max.
        boundaries: ``nu``, ``[C, ...]``, pixels from the line's middle.
        crossing: ``[C, ...]`` bool, whether there is such a boundary.
        sigma: width of G, pixels.
        reach: L / 2.

    Returns:
        ``[...]``.
    """
    places, present = features
    dtype = places.dtype
    counted = jnp.sum(present, axis=0, dtype=jnp.int32)
    crossed = jnp.sum(crossing, axis=0, dtype=jnp.int32)
    law = boundary_law(places[None], boundaries[:, None], sigma, reach)
    sums = matchings(jnp.where(present[None] & crossing[:, None], law, 0.0).astype(dtype))
    weights = jnp.asarray(weights, dtype)
    num_counts = weights.shape[2]
    place = crossed * num_counts + counted
    table = weights.reshape(weights.shape[0], -1)
    ratio = sum(
        (table[k][place] * matched for k, matched in enumerate(sums)),
        start=jnp.zeros((), dtype),
    )
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
