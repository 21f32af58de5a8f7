"""Deterministic resampling: blend particles by entropy-regularised optimal transport.

Corenflos, Thornton, Deligiannidis & Doucet 2021, "Differentiable particle filtering via
entropy-regularized optimal transport": with P the plan that transports the weights to equal
weights, particle i becomes ``n sum_j P_ij x_j``.  OTT's Sinkhorn solver
(``pip install 'jaxpf[transport]'``) computes the plan; the implicit function theorem gives its
derivative.

Time and memory grow with N^2, the time of a gradient with N^3.  Blending contracts the particles,
so the evidence and the spread are biased, more for a larger ``epsilon``.  It mixes whole particles:
all partitions, and the substates of the previous frame.  Each particle then descends from all
others: lineages are meaningless and ``Summary.distinct_share`` is always 1; use ``ess`` instead.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.state import ParticleState
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.resampling.components import Components, component_cdf, few_effective, one_component

#: Total error of the marginals at which the Sinkhorn iteration stops.
THRESHOLD = 1e-3
MAX_ITERATIONS = 500
MISSING = "gradient Transport needs the package ott-jax; pip install 'jaxpf[transport]'."


def blend_state(
    epsilon: ArrayLike, state: ParticleState, ess_threshold: Any = None
) -> ParticleState:
    """Blend a frame's weighted set into particles of equal weight, in place of resampling."""
    whole = one_component(state.log_weights.shape[0])
    lagged, log_weights, blended = blend(
        epsilon, state.lagged, state.log_weights, whole, ess_threshold
    )

    def where(first, other):
        return jnp.where(state.weighted & blended, first, other)

    return dataclasses.replace(
        state,
        lagged=where(lagged, state.lagged),
        log_weights=where(log_weights, state.log_weights),
        weighted=state.weighted & ~blended,
    )


def blend(
    epsilon: ArrayLike,
    lagged: jax.Array,
    log_weights: jax.Array,
    components: Components,
    ess_threshold: Any = None,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Blend within components; adaptively with ``ess_threshold``.

    Args:
        epsilon: strength of the regularisation.
        lagged: ``[2, D, P, N]``, current and previous substates.
        log_weights: ``[N]``; a component keeps its total weight.
        components: the division of the particles.
        ess_threshold: see ``Partitioned``.

    Returns:
        Blended substates, log-weights, and whether all components were blended.
    """
    cdf = component_cdf(log_weights, components)
    chosen = cdf.alive
    if ess_threshold is not None:
        chosen &= few_effective(log_weights, components, ess_threshold)
    here = components.spread(chosen)
    size = components.spread(components.size).astype(log_weights.dtype)
    relative = log_weights - components.spread(jnp.where(cdf.alive, cdf.log_mean, 0.0))
    # Sinkhorn takes logarithms of weights: replacing zero by 1e-10 keeps them finite.
    relative = jnp.where(jnp.isneginf(log_weights), 0.0, relative)
    shares = jnp.where(jnp.isneginf(log_weights), 0.0, jnp.exp(relative))
    shares = jnp.maximum(shares, 1e-10)
    shares = shares * (size / components.spread(components.sum_of(shares)))
    plan = _plan(epsilon, lagged, shares, components)
    flat = lagged.reshape(-1, lagged.shape[-1])
    blended = jnp.where(here, flat @ plan.T, flat).reshape(lagged.shape)
    mean = components.spread(cdf.log_mean)
    return blended, jnp.where(here, mean, log_weights), jnp.all(chosen | (components.size == 0))


def _plan(epsilon, lagged, shares, components: Components) -> jax.Array:
    """``[N, N]``: row i holds slot i's share of every particle; rows sum to one."""
    try:
        from ott.geometry.geometry import Geometry
        from ott.problems.linear.linear_problem import LinearProblem
        from ott.solvers.linear.sinkhorn import Sinkhorn
    except ImportError as error:
        raise InputError(MISSING) from error
    num_particles = lagged.shape[-1]
    values = lagged[0].reshape(-1, num_particles)
    # Coordinates have different units: scale each by its standard deviation.
    weights = shares / num_particles
    centred = values - (values @ weights)[:, None]
    variance = centred**2 @ weights
    scaled = centred / jnp.sqrt(jnp.where(variance > 0, variance, 1.0))[:, None]
    squares = jnp.sum(scaled**2, axis=0)
    cost = squares[:, None] + squares[None, :] - 2 * scaled.T @ scaled
    cost = jnp.maximum(cost, 0.0) / values.shape[0]
    same = components.index[:, None] == components.index[None, :]
    # Prevents transport across components: exp(-200) is negligible.
    cost = jnp.where(same, cost, 200.0 * epsilon + lax.stop_gradient(jnp.max(cost)))
    target = jnp.full_like(shares, 1 / num_particles)
    geometry = Geometry(cost_matrix=lax.stop_gradient(cost), epsilon=lax.stop_gradient(epsilon))
    problem = LinearProblem(geometry, a=target, b=lax.stop_gradient(weights))
    solution = Sinkhorn(threshold=THRESHOLD, max_iterations=MAX_ITERATIONS)(problem)
    potentials = lax.stop_gradient(solution.f), lax.stop_gradient(solution.g)
    log_plan = _with_implicit_gradient(potentials, cost, epsilon, target, weights, same)
    return jax.nn.softmax(jnp.where(same, log_plan, -jnp.inf), axis=1)


def _with_implicit_gradient(potentials, cost, epsilon, target, weights, same) -> jax.Array:
    """Log of the plan, ``[N, N]``, with the derivative of the potentials in the inputs.

    By the implicit function theorem: take one Newton step from the solution towards the marginals
    and keep only its derivative.  A potential is determined up to a constant in each component, so
    the system is singular, and nearly singular for clusters that exchange little mass; an iterative
    solver fails on it in float32.
    """
    f, g = potentials
    epsilon = jnp.asarray(epsilon, cost.dtype)
    log_plan = (f[:, None] + g[None, :] - cost) / epsilon
    row = jax.nn.logsumexp(log_plan, axis=1) - jnp.log(target)
    column = jax.nn.logsumexp(log_plan, axis=0) - jnp.log(weights)
    of_row = lax.stop_gradient(jax.nn.softmax(log_plan, axis=1))
    of_column = lax.stop_gradient(jax.nn.softmax(log_plan, axis=0))
    num_particles = cost.shape[0]
    constants = same / jnp.sum(same, axis=1, dtype=cost.dtype)
    ridge = num_particles * jnp.finfo(cost.dtype).eps
    identity = jnp.eye(num_particles, dtype=cost.dtype)
    system = (1 + ridge) * identity - of_row @ of_column.T + constants
    change_of_f = -epsilon * jnp.linalg.solve(system, row - of_row @ column)
    change_of_g = -epsilon * column - of_column.T @ change_of_f
    return with_gradient_of(log_plan, (change_of_f[:, None] + change_of_g[None, :]) / epsilon)
