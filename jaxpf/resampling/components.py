"""Contiguous components with sizes set at run time; sums, maxima and weights within them."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.lowering import platform
from jaxpf.lowering.derivatives import weighted, with_gradient_of
from jaxpf.lowering.prefix import quick_sum, running_max


@pytree_dataclass
class Components:
    """A division of N slots into C contiguous components, some of which may be empty.

    Attributes:
        index: ``[N]`` int32, the component of each slot, non-decreasing.
        start: ``[C]`` int32, the first slot of each component.
        size: ``[C]`` int32, the number of slots of each component; sums to N.
    """

    index: jax.Array
    start: jax.Array
    size: jax.Array

    def spread(self, values: jax.Array) -> jax.Array:
        """Broadcast ``values`` ``[C]`` to the slots of each component: ``[N]``."""
        if self.size.shape[0] == 1:
            return jnp.broadcast_to(values, self.index.shape)
        return values[self.index]

    def last_of(self, values: jax.Array) -> jax.Array:
        """``[C]``: the entry of ``values`` ``[N]`` at each component's last slot."""
        return values[jnp.maximum(self.start + self.size - 1, 0)]

    def sum_of(self, values: jax.Array) -> jax.Array:
        """``[C]``: the sum of ``values`` ``[N]`` over each component."""
        if self.size.shape[0] == 1:
            return jnp.sum(values)[None]
        return jnp.zeros(self.size.shape, values.dtype).at[self.index].add(values)


def components_of_sizes(sizes: jax.Array, num_particles: int) -> Components:
    """Contiguous components of the given sizes ``[C]`` (int, traced), which sum to N."""
    sizes = jnp.asarray(sizes, jnp.int32)
    ends = jnp.cumsum(sizes)
    slots = jnp.arange(num_particles, dtype=jnp.int32)
    index = jnp.sum(ends[:, None] <= slots[None, :], axis=0, dtype=jnp.int32)
    return Components(index=index, start=ends - sizes, size=sizes)


def one_component(num_particles: int) -> Components:
    """All slots in a single component."""
    return components_of_sizes(jnp.array([num_particles]), num_particles)


@pytree_dataclass
class ComponentCDF:
    """The cumulative distribution of each component.

    Attributes:
        weights: ``[N]``, scaled so that each component's largest weight is 1.
        cumulative: ``[N]``, ``quick_sum`` of ``weights`` within the component.
        total: ``[C]``, sum of ``weights``.
        alive: ``[C]`` bool, false for a component whose weights are all zero.
        log_mean: ``[C]``, log of the mean weight before scaling.
    """

    weights: jax.Array
    cumulative: jax.Array
    total: jax.Array
    alive: jax.Array
    log_mean: jax.Array


def component_cdf(
    log_weights: jax.Array, components: Components, largest: jax.Array | None = None
) -> ComponentCDF:
    """Cumulative weights within each component, scaled by the component's largest weight.

    Only ``log_mean`` is differentiable; the other fields serve draws, which are not.
    """
    differentiated, log_weights = log_weights, lax.stop_gradient(log_weights)
    if largest is None:
        largest = component_max(log_weights, components)
    alive = ~jnp.isneginf(largest)
    reference = components.spread(jnp.where(alive, largest, 0.0))
    relative = jnp.where(components.spread(alive), log_weights - reference, 0.0)
    weights = jnp.exp(relative)
    cumulative = quick_sum(weights, ranks(components))
    total = components.last_of(cumulative)
    size = jnp.maximum(components.size, 1).astype(weights.dtype)
    log_mean = jnp.where(alive, largest + jnp.log(total) - jnp.log(size), -jnp.inf)
    share = weights / components.spread(jnp.where(total > 0, total, 1.0))
    share = jnp.where(components.spread(alive), share, 0.0)
    log_mean = with_gradient_of(log_mean, components.sum_of(weighted(share, differentiated)))
    return ComponentCDF(weights, cumulative, total, alive, log_mean)


def component_max(values: jax.Array, components: Components) -> jax.Array:
    """``[C]``: the largest of ``values`` ``[N]`` in each component; -inf if empty.

    Not differentiable.
    """
    values = lax.stop_gradient(values)
    if components.size.shape[0] == 1:
        return jnp.max(values)[None]

    if platform.on_accelerator():  # one kernel, and no branch
        mine = components.index == jnp.arange(components.size.shape[0])[:, None]
        return jnp.max(jnp.where(mine, values, -jnp.inf), axis=1)

    def of_each():
        largest = components.last_of(running_max(values, ranks(components)))
        return jnp.where(components.size > 0, largest, -jnp.inf)

    def of_all():
        return jnp.full(components.size.shape, -jnp.inf, values.dtype).at[0].set(jnp.max(values))

    # The same for all runs unless particles keep components, so only one branch is computed.
    return lax.cond(components.size[0] == values.shape[0], of_all, of_each)


def ranks(components: Components) -> jax.Array | None:
    """Index of each slot within its component; None if the shape implies one component."""
    if components.size.shape[0] == 1:
        return None
    slots = jnp.arange(components.index.shape[0], dtype=jnp.int32)
    return slots - components.spread(components.start)


def few_effective(
    log_weights: jax.Array, components: Components, threshold: "jax.Array | float"
) -> jax.Array:
    """``[C]`` bool: whether the component's effective sample size is <= threshold * n_c."""
    cdf = component_cdf(log_weights, components)
    squares = components.last_of(quick_sum(cdf.weights**2, ranks(components)))
    return cdf.total**2 <= threshold * components.size.astype(squares.dtype) * squares
