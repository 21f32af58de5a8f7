"""Regularised estimates of position and speed, and feedback of the speed (rowe2005, eq. 5-6).

With x and u a target's estimated position and speed, and a_x, a_u the rates of ``regularise``::

    x_t = (1 - a_x) (x_{t-1} + u_{t-1}) + a_x sum(w x^) / sum(w)
    u_t = (1 - a_u) u_{t-1} + a_u (x_t - x_{t-1})

Time is counted in frames.  As printed, eq. 6 divides the sum of eq. 4's weights by N_l, which is
off by a factor 1 / (L N_l), and omits the division of the speed by the time step.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jaxpf.filters.labelled import by_label


def regularised(
    mean: jax.Array,
    estimate: jax.Array,
    velocity: jax.Array,
    present: jax.Array,
    position: Sequence[int],
    speed: Sequence[int] | None,
    rates: ArrayLike | None,
) -> tuple[jax.Array, jax.Array]:
    """Update the regularised estimates and speeds from the last frame's (rowe2005, eq. 6).

    Args:
        mean: ``[D, L]``, this frame's weighted means.
        estimate: ``[D, L]``, last frame's estimates.
        velocity: ``[E, L]``, last frame's speeds, per frame.
        present: ``[L]`` bool; a label without weight coasts at its speed.
        position: indices of the E position coordinates.
        speed: indices of the E speed coordinates, which then report the estimated speed; or None.
        rates: a_x and a_u, ``[2]``; None is 1 and 1.

    Returns:
        Estimates ``[D, L]`` and speeds ``[E, L]``.
    """
    rows = jnp.asarray(position)
    along, change = (1.0, 1.0) if rates is None else jnp.asarray(rates, mean.dtype)
    before = estimate[rows]
    predicted = before + velocity
    moved = jnp.where(present, (1 - along) * predicted + along * mean[rows], predicted)
    velocity = jnp.where(
        present, (1 - change) * velocity + change * (moved - before), velocity
    ).astype(mean.dtype)
    reported = jnp.where(present, mean, estimate).at[rows].set(moved)
    if speed is not None:
        reported = reported.at[jnp.asarray(speed)].set(velocity)
    return reported, velocity


def before_moving(
    lagged: jax.Array, velocity: jax.Array, labels: jax.Array, position: Sequence[int]
) -> jax.Array:
    """Replace the last displacement in ``lagged`` ``[2, D, N]`` by the label's estimated speed.

    Feeds speed back to dynamics that take it from ``current - previous``.
    """
    rows = jnp.asarray(position)
    return lagged.at[1, rows].set(lagged[0, rows] - by_label.spread(velocity, labels))


def after_moving(
    moved: jax.Array,
    current: jax.Array,
    velocity: jax.Array,
    labels: jax.Array,
    speed: Sequence[int],
) -> jax.Array:
    """Base the new speed of particles ``[D, N]`` on the label's speed, not their own (eq. 5).

    Keeps the change of speed from the dynamics, mainly its noise.  A particle's own last speed has
    already moved its position.
    """
    rows = jnp.asarray(speed)
    return moved.at[rows].add(by_label.spread(velocity, labels) - current[rows])
