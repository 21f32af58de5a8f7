"""Regularised estimates of position and speed, and feedback of the speed (rowe2005, eq. 5-6).

With x and u a target's estimated position and speed, and a_x, a_u the rates of ``regularise``::

    x_t = (1 - a_x) (x_{t-1} + u_{t-1}) + a_x sum(w x^) / sum(w)
    u_t = (1 - a_u) u_{t-1} + a_u (x_t - x_{t-1})

Time is counted in frames.  As printed, eq. 6 divides the sum of eq. 4's weights by N_l, which
is off by a factor 1 / (L N_l), and leaves out the division of the speed by the time step.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.filters.labelled import by_label


def regularised(
    mean: jax.Array,
    estimate: jax.Array,
    velocity: jax.Array,
    present: jax.Array,
    position: Sequence[int],
    speed: Sequence[int] | None,
    rates: Any,
) -> tuple[jax.Array, jax.Array]:
    """Estimates and speeds of this frame from those of the last.

    Args:
        mean: ``[D, L]``, weighted means of this frame.
        estimate: ``[D, L]``, of the last frame.
        velocity: ``[E, L]``, speeds of the last frame, per frame.
        present: ``[L]`` bool; a label without weight coasts: it is moved on at its speed.
        position: the E coordinates of a position.
        speed: the E coordinates of a speed, which are reported as estimated; or None.
        rates: a_x and a_u, ``[2]``; None is 1 and 1.

    Returns:
        ``[D, L]`` and ``[E, L]``.
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
    """Lags ``[2, D, N]`` whose last displacement is the label's estimated speed.

    How speed is fed back to a dynamics that takes it from ``current - previous``.
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
    """Particles ``[D, N]`` whose new speed starts from the label's, not from their own (eq. 5).

    The dynamics' change of speed, its noise above all, is kept; a particle's own last speed
    has moved its position already.
    """
    rows = jnp.asarray(speed)
    return moved.at[rows].add(by_label.spread(velocity, labels) - current[rows])
