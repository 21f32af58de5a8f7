"""Lines that are not independent: log-ratios with a weight below one, normalised to densities.

Neighbouring lines see the same blurred edge, and have the same error if the shape space is wrong;
with full weight, one particle would dominate all others.  So each line counts as ``r^s``, where r
is its ratio of densities and s, the share, its weight.  By Jensen's inequality the mean of ``r^s``
is below one if that of r is one, and equals one only where no boundary is expected.  With s = .3 or
.5 it is .7 to .8 per line, which would favour a contour that is hidden or outside the frame.  Each
line is therefore divided by its mean,

    m = E[(p~(z | own and others) / p~(z | others))^s]   under   p~(z | others),

so that a contour's own lines are densities again, for every s.  m depends on the number of visible
edges of the own boundary, and on where others cross the line.  It is integrated numerically, for no
and for one other boundary, by that boundary's distance from the line's middle.  If several others
cross, the nearest represents them, and the line's mean is only approximately one: 1.01 to 1.05 for
a wire beside a wire, both of whose edges are visible.

The likelihoods as printed (``reward="literal"``) are not densities: their ratio is to clutter, not
to what others explain, and beside another target a line's mean is .8 to .9 (s = .3).  A likelihood
that counts further crossings of a line with its own contour is not one either, since m takes these
as given.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.likelihoods.contours.edges import Features
from jaxpf.likelihoods.contours.line_model import at_most_shown, line_weights, log_ratios

#: Points of the integration over the places of features; distances of another boundary.
_POINTS, _NODES = 512, 9


def log_means(clutter, detection, sigma, share, offsets, length: float) -> jax.Array:
    """``log m`` by the visible boundaries, ``[edges + 1, 1 + nodes]``; all 0 if the share is 1.

    Args:
        clutter: b(n), ``[n_max + 1]``.
        detection: ``q_kc``, ``[c, k]``.
        sigma: standard deviation of G, pixels.
        share: s.
        offsets: of the own boundary's edges, pixels from the line's middle.
        length: L, pixels.

    Returns:
        Rows: number of visible own edges.  Columns: no other boundary, then one at distances from
        0 to L / 2.
    """
    reach, most = length / 2, len(clutter) - 1
    away = np.linspace(0, reach, _NODES)
    # The last column holds no other boundary.
    others = jnp.asarray([*away, 0.0]), np.arange(_NODES + 1) < _NODES
    places = (_spread_points(most).T[:, :, None, None] - 0.5) * length
    shown = np.arange(most + 1)
    features = Features(
        jnp.broadcast_to(places, (most, _POINTS, most + 1, 1)),
        jnp.broadcast_to(
            np.arange(most)[:, None, None, None] < shown[:, None], (most, 1, most + 1, 1)
        ),
    )
    law = at_most_shown(clutter)
    weights = line_weights(clutter, detection, length)
    rows = [jnp.zeros(_NODES + 1)]
    for seen in range(1, len(offsets) + 1):
        own = [jnp.broadcast_to(offset, _NODES + 1) for offset in offsets[:seen]]
        boundaries = jnp.stack([*own, others[0]])
        there = np.stack([*[np.ones(_NODES + 1, bool)] * seen, others[1]])
        with_own, without = log_ratios(
            weights, features, boundaries[:, None, None], there[:, None, None], sigma, reach,
            [range(seen + 1), [seen]],
        )  # fmt: skip
        shared = jnp.exp(share * with_own + (1 - share) * without)
        # The mean over few points, divided by that of a similar function whose true mean is one.
        alike = share * jnp.exp(with_own) + (1 - share) * jnp.exp(without)
        rows.append(jnp.log(law @ jnp.mean(shared, axis=0) / (law @ jnp.mean(alike, axis=0))))
    factors = jnp.roll(jnp.stack(rows), 1, axis=1)
    return jnp.where(share < 1, factors, 0.0)


def log_mean_of(table, seen, others, there, reach):
    """``log m`` of lines ``[...]``.

    Args:
        table: from ``log_means``.
        seen: number of visible edges of the own boundary, ``[...]``.
        others: places of other boundaries, ``[C, ...]``, C may be 0.
        there: bool, whether they exist.
        reach: L / 2.
    """
    columns = table.shape[1]
    alone = table[seen, 0]
    nearest = jnp.min(jnp.where(there, jnp.abs(others), reach), axis=0, initial=reach)
    place = nearest / reach * (columns - 2)
    node = jnp.clip(place.astype(jnp.int32), 0, columns - 3)
    flat, start = table.reshape(-1), seen * columns + 1 + node
    between = flat[start] + (place - node) * (flat[start + 1] - flat[start])
    return jnp.where(jnp.any(there, axis=0), between, alone)


def _spread_points(dimensions: int) -> np.ndarray:
    """Points ``[K, dimensions]``, evenly spread in the unit cube (Kronecker, plastic ratios)."""
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    return (0.5 + np.arange(1, _POINTS + 1)[:, None] * steps) % 1
