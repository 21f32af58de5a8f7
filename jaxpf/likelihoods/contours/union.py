"""The joint density of the lines of all targets, in which one edge is rewarded once.

Each target has its own measurement lines, and these cross the boundaries of others.  So one edge is
seen twice: on the lines of its own target, and on those of every target nearby.  maccormick1999
multiplies over all lines as if they were independent (eq. 2 and 5), and so rewards the edge twice:
an outline drawn anywhere inside an opaque target in front is, on each of its lines, rewarded with
the front target's edge, and is as likely as the truth.

**The density.**  Let Z_j be the features on the lines of target j, Z those on all lines, and
``p~(Z_j | S)`` the product over j's lines of ``p~_c`` (``line_model``) with the visible boundaries
of a set S of targets; ``p~(Z_j | none)`` is clutter, ``p_0(Z_j)``.  Add the targets to the picture
one after another, and let each one change only the distribution of its own lines, given everything
added before:

    p(Z | S and j) / p(Z | S) = p~(Z_j | S and j) / p~(Z_j | S).

In the order 1, 2, .. P it follows that

    p(Z | 1 .. P) / p_0(Z) = prod_j  p~(Z_j | 1 .. j) / p~(Z_j | 1 .. j - 1).

Factor j has mean one under ``p~(Z_j | 1 .. j - 1)``, the distribution of these lines before target
j was added.  So the product is a density if the lines of a later target show the earlier ones as
the line model says.  Under pure clutter on independent lines its mean is not one, and need not be:
two lines that cross one edge are not independent.  In the extreme case that two targets' lines are
the same line, it is exactly ``p~(z | both) / p_0(z)``.  Where no line meets another target it is
the product of the one-body densities.

The edge of target 1 is rewarded on its own lines.  On the lines of target 2 it appears in numerator
and denominator: it explains its features away, so that they do not support target 2, and earns
nothing.  A target whose boundary is completely hidden contributes a factor of one, wherever it is.

**Within a contour** the same rule holds: its pieces are added one after another, from its first
point to its last, so a crossing of a line with an earlier piece was there before.  Without this
rule a contour folded back on itself is rewarded twice for one edge: folded on 45% of a worm it
scores 24.6, the truth 24.7.

Which target comes first is unknown, so the density is a mean over the cyclic orders of the targets,
from every start and in both directions: all orders of two or three; for more, a subset in which
each target comes equally often first, second and so on.  A mean of densities is a density.  Which
of two opaque targets is in front matters only through the visible boundaries, so **the label makes
no difference while nothing is hidden**.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np


def orders(num_targets: int) -> list[tuple[int, ...]]:
    """The cyclic orders of the targets, from every start and in both directions, each once."""
    return list(
        dict.fromkeys(
            tuple((start + way * place) % num_targets for place in range(num_targets))
            for way in (1, -1)
            for start in range(num_targets)
        )
    )


def sets_before(num_targets: int) -> list[tuple[int, ...]]:
    """Sets of targets that precede a target in any order, as cyclic offsets from it.

    Each set once; the first is empty.
    """
    return list(
        dict.fromkeys(
            _before(order, place) for order in orders(num_targets) for place in range(num_targets)
        )
    )


def _before(order: tuple[int, ...], place: int) -> tuple[int, ...]:
    return tuple(sorted((target - order[place]) % len(order) for target in order[:place]))


def mean_over_orders(factors) -> jax.Array:
    """Log of the mean over orders of the product of the targets' factors.

    Args:
        factors: ``[S, P, ...]``, for each of ``sets_before`` and every target j,
            ``log p~(Z_j | S and j) / p~(Z_j | S)``.

    Returns:
        ``[...]``.
    """
    factors = jnp.asarray(factors)
    num_targets = factors.shape[1]
    sets, chosen = sets_before(num_targets), np.array(orders(num_targets))
    before = [
        [sets.index(_before(order, place)) for place in range(num_targets)]
        for order in orders(num_targets)
    ]
    products = jnp.sum(factors[np.array(before), chosen], axis=1)
    return jax.nn.logsumexp(products, axis=0) - math.log(len(chosen))
