"""From weights to ancestors, within contiguous components with sizes set at run time.

All schemes satisfy one contract: ``ancestors(key, log_weights, scheme, components)`` returns
``[N]`` int32, each slot's ancestor lies in the slot's component, and particle i has ``n_c * w_i``
offspring on average within its component c.  A particle of zero weight never has offspring.  A
component whose weights are all zero keeps its particles (identity).

Weighted resampling (maccormick1999, section 5; smith2004, section 3) selects by one function and
divides the weights by it, so that the weighted set keeps its expectation.
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.logs import normalised
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.resampling.components import (
    Components,
    component_cdf,
    component_max,
    one_component,
)
from jaxpf.resampling.schemes import BuiltIn, Own, scheme_of

#: Uniform draws in float32 are multiples of 2^-23: more particles are not all reached.
_MOST_IN_SINGLE = 2**23


def ancestors(
    key: jax.Array,
    log_weights: jax.Array,
    scheme: str | BuiltIn | Own = "systematic",
    components: Components | None = None,
) -> jax.Array:
    """Draw the ancestor of every slot.

    Args:
        key: a JAX random key.
        log_weights: ``[N]``, unnormalised; NaN counts as zero weight.  Particles of weight +inf
            share all offspring of their component.
        scheme: one of ``SCHEMES``, or a custom scheme.
        components: how the slots divide into components; default one.

    Returns:
        ``[N]`` int32 indices of particles, each in its slot's own component.
    """
    of_all = one_component(log_weights.shape[0]) if components is None else components
    largest = component_max(jnp.where(jnp.isnan(log_weights), -jnp.inf, log_weights), of_all)
    only_infinite = jnp.where(jnp.isposinf(log_weights), 0.0, -jnp.inf)
    log_weights = jnp.where(jnp.isposinf(of_all.spread(largest)), only_infinite, log_weights)
    return weighted_resample(key, log_weights, log_weights, scheme, components)[0]


def weighted_resample(
    key: jax.Array,
    log_weights: jax.Array,
    log_selection: jax.Array,
    scheme: str | BuiltIn | Own = "systematic",
    components: Components | None = None,
    largest: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Select particles by one function and divide their weights by it.

    Within each component of n slots, with ``rho = selection / sum(selection)``, slot i draws
    ancestor k from rho and gets the weight ``w_k / (n rho_k)``.  The papers omit the 1/n, which
    keeps ``E[sum_i w_i f(x_i)]`` and therefore the evidence estimate unchanged (smith2004,
    figure 1; maccormick1999, figure 8).

    Args:
        key: a JAX random key.
        log_weights: ``[N]``.  A component's total weight is unchanged in expectation.
        log_selection: ``[N]``, log of the selecting function, unnormalised.  It must be finite
            wherever the weight is nonzero.
        scheme: one of ``SCHEMES``, or a custom scheme.
        components: how the slots divide into components; default one.
        largest: ``[C]``, the largest ``log_selection`` of each component, if already computed.

    Returns:
        Ancestors ``[N]`` int32 and the new log-weights ``[N]``.
    """
    num_particles = log_weights.shape[0]
    if num_particles > _MOST_IN_SINGLE and log_weights.dtype.itemsize < 8:
        raise InputError(
            f"{num_particles} particles are more than float32 can draw from ({_MOST_IN_SINGLE}: "
            "beyond, running sums of weights skip particles); use fewer, "
            "jaxpf.filters.SideBySide, or jax.config.update('jax_enable_x64', True)."
        )
    if components is None:
        components = one_component(num_particles)
    by_weight = log_selection is log_weights
    log_selection = jnp.where(jnp.isnan(log_selection), -jnp.inf, log_selection)
    cdf = component_cdf(log_selection, components, largest)
    alive = components.spread(cdf.alive)
    chosen = scheme_of(scheme).within(key, cdf, components)
    chosen = jnp.where(alive, chosen, jnp.arange(num_particles, dtype=jnp.int32))
    new_log_weights = components.spread(cdf.log_mean)
    if not by_weight:
        selectable = ~jnp.isneginf(log_selection)
        correction = jnp.where(selectable, log_weights - log_selection, 0.0)
        new_log_weights += correction[chosen]
    return chosen, jnp.where(alive, new_log_weights, log_weights)


def soft_selection(log_weights: jax.Array, share: ArrayLike, components: Components) -> jax.Array:
    """Log of the mixture ``share * rho + (1 - share) / n`` of weights and uniform, ``[N]``.

    Selecting by the mixture and reweighting keeps a derivative (Karkus, Hsu & Lee 2018, "soft
    resampling").  A component whose weights are all zero stays unchanged.
    """
    cdf = component_cdf(log_weights, components)
    alive, part = components.spread(cdf.alive), jnp.asarray(share, log_weights.dtype)
    # Relative to the component's mean weight, the uniform distribution is 1.
    relative = log_weights - components.spread(jnp.where(cdf.alive, cdf.log_mean, 0.0))
    relative = jnp.where(alive, relative, 0.0)
    rest = jnp.log1p(-jnp.minimum(part, 1 - jnp.finfo(part.dtype).eps))
    mixed = jnp.logaddexp(jnp.log(part) + relative, rest)
    return jnp.where(alive, mixed, -jnp.inf)


def keep_total(log_weights: jax.Array, before: jax.Array, components: Components) -> jax.Array:
    """Give a component's new weights ``[N]`` the derivative of their total ``before`` selection.

    The new weights' total has the correct expectation but not its derivative.  Values do not
    change.
    """
    change = component_cdf(before, components).log_mean
    change -= component_cdf(log_weights, components).log_mean
    return with_gradient_of(log_weights, components.spread(change))


def renormalised(log_weights: jax.Array, components: Components) -> jax.Array:
    """smith2004's literal reassembly: each component's weights sum to its share n_c / N."""
    cdf = component_cdf(log_weights, components)
    mean = components.spread(jnp.where(cdf.alive, cdf.log_mean, 0.0))
    scaled = jnp.where(components.spread(cdf.alive), log_weights - mean, -jnp.inf)
    return normalised(scaled)[0]
