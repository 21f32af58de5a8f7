"""From weights to ancestors, within contiguous components of any run-time size.

Four schemes share one contract: ``ancestors(key, log_weights, scheme, components)`` gives
``[N]`` int32, every slot's ancestor lies in the slot's own component, and the expected
number of offspring of particle i is ``n_c * w_i`` within its component c.  A particle of
zero weight never has offspring.  A component whose weights are all zero keeps its
particles (identity): there is nothing to choose by.

Weighted resampling (maccormick1999, section 5; smith2004, section 3) selects by one
function and corrects by its inverse, so that the weighted set keeps its expectation.
"""

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.errors import InputError
from jaxpf.prefix import running_max, running_sum, segment_starts
from jaxpf.pytree import pytree_dataclass

SCHEMES = ("systematic", "stratified", "multinomial", "residual")


@pytree_dataclass
class Components:
    """A division of N slots into C contiguous components, empty ones included.

    Attributes:
        index: ``[N]`` int32, the component of each slot, never decreasing.
        start: ``[C]`` int32, the first slot of each component.
        size: ``[C]`` int32, the number of slots; sums to N.
    """

    index: jax.Array
    start: jax.Array
    size: jax.Array


def components_of_sizes(sizes: jax.Array, num_particles: int) -> Components:
    """Contiguous components of the given sizes ``[C]`` (int, traced), summing to N."""
    sizes = jnp.asarray(sizes, jnp.int32)
    ends = jnp.cumsum(sizes)
    slots = jnp.arange(num_particles, dtype=jnp.int32)
    index = jnp.sum(ends[:, None] <= slots[None, :], axis=0, dtype=jnp.int32)
    return Components(index=index, start=ends - sizes, size=sizes)


def one_component(num_particles: int) -> Components:
    """All slots in a single component."""
    return components_of_sizes(jnp.array([num_particles]), num_particles)


def check_scheme(scheme: str) -> None:
    """Raise ``InputError`` unless ``scheme`` is one of ``SCHEMES``."""
    if scheme not in SCHEMES:
        raise InputError(
            f"resampling={scheme!r} is not a resampling scheme; choose one of {', '.join(SCHEMES)}."
        )


def ancestors(
    key: jax.Array,
    log_weights: jax.Array,
    scheme: str = "systematic",
    components: Components | None = None,
) -> jax.Array:
    """Draw the ancestor of every slot.

    Args:
        key: a JAX random key.
        log_weights: ``[N]``, unnormalised; NaN counts as zero weight.
        scheme: one of ``SCHEMES``.
        components: how the slots divide into components; default one.

    Returns:
        ``[N]`` int32 indices of particles, each in its slot's own component.

    Raises:
        InputError: unknown scheme.
    """
    return weighted_resample(key, log_weights, log_weights, scheme, components)[0]


def weighted_resample(
    key: jax.Array,
    log_weights: jax.Array,
    log_selection: jax.Array,
    scheme: str = "systematic",
    components: Components | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Select particles by one function and correct their weights by its inverse.

    Within each component of n slots, with ``rho = selection / sum(selection)``, slot i
    draws ancestor k from rho and gets the weight ``w_k / (n rho_k)``.  The papers drop
    the 1/n; it is what keeps ``E[sum_i w_i f(x_i)]`` and so the evidence estimate
    unchanged (smith2004, figure 1; maccormick1999, figure 8).

    Args:
        key: a JAX random key.
        log_weights: ``[N]``.  A component's total weight is unchanged in expectation.
        log_selection: ``[N]``, log of the selecting function, unnormalised.  It must be
            finite wherever the weight is not zero.
        scheme: one of ``SCHEMES``.
        components: how the slots divide into components; default one.

    Returns:
        Ancestors ``[N]`` int32 and the new log-weights ``[N]``.
    """
    check_scheme(scheme)
    num_particles = log_weights.shape[0]
    if components is None:
        components = one_component(num_particles)
    log_selection = jnp.where(jnp.isnan(log_selection), -jnp.inf, log_selection)
    cdf = component_cdf(log_selection, components)
    chosen = _SCHEMES[scheme](key, cdf)
    chosen = jnp.where(cdf.alive, chosen, jnp.arange(num_particles, dtype=jnp.int32))
    selectable = ~jnp.isneginf(log_selection)
    correction = jnp.where(selectable, log_weights, 0.0) - jnp.where(selectable, log_selection, 0.0)
    new_log_weights = correction[chosen] + cdf.log_mean
    return chosen, jnp.where(cdf.alive, new_log_weights, log_weights)


@pytree_dataclass
class ComponentCDF:
    """The cumulative distribution of each component, spread over its slots.

    Attributes:
        cumulative: ``[N]``, running sum of the weights (largest = 1) within the component.
        total: ``[N]``, the component's total of the same.
        alive: ``[N]`` bool, false in a component whose weights are all zero.
        log_mean: ``[N]``, log of the mean weight of the slot's component.
        weights: ``[N]``, the terms of the running sum.
        start: ``[N]`` int32, first slot of the slot's component.
        size: ``[N]`` int32, number of slots in it.
    """

    cumulative: jax.Array
    total: jax.Array
    alive: jax.Array
    log_mean: jax.Array
    weights: jax.Array
    start: jax.Array
    size: jax.Array


def component_cdf(log_weights: jax.Array, components: Components) -> ComponentCDF:
    """Cumulative weights within each component, each scaled by its own largest weight."""
    first = _starts(components)
    last = jnp.maximum(components.start + components.size - 1, 0)
    largest = component_max(log_weights, components)
    alive = ~jnp.isneginf(largest)
    relative = jnp.where(alive, log_weights - jnp.where(alive, largest, 0.0), 0.0)
    weights = jnp.exp(relative)
    cumulative = running_sum(weights, first)
    total = cumulative[last][components.index]
    size = components.size[components.index]
    log_mean = jnp.where(
        alive, largest + jnp.log(total) - jnp.log(size.astype(weights.dtype)), -jnp.inf
    )
    return ComponentCDF(
        cumulative=cumulative,
        total=total,
        alive=alive,
        log_mean=log_mean,
        weights=weights,
        start=components.start[components.index],
        size=size,
    )


def component_max(values: jax.Array, components: Components) -> jax.Array:
    """``[N]``: the largest of ``values`` ``[N]`` in each slot's component."""
    if components.size.shape[0] == 1:
        return jnp.broadcast_to(jnp.max(values), values.shape)
    last = jnp.maximum(components.start + components.size - 1, 0)
    return running_max(values, _starts(components))[last][components.index]


def _starts(components: Components) -> jax.Array | None:
    """Where components begin; None where the shape alone says that there is one."""
    return None if components.size.shape[0] == 1 else segment_starts(components.index)


def few_effective(
    log_weights: jax.Array, components: Components, threshold: jax.Array
) -> jax.Array:
    """``[N]`` bool: the slot's component has an effective sample size <= threshold * n."""
    last = jnp.maximum(components.start + components.size - 1, 0)
    cdf = component_cdf(log_weights, components)
    squares = running_sum(cdf.weights**2, _starts(components))[last][components.index]
    return cdf.total**2 <= threshold * cdf.size.astype(squares.dtype) * squares


def inverse_cdf(
    cumulative: jax.Array, targets: jax.Array, start: jax.Array, size: jax.Array
) -> jax.Array:
    """First position in ``[start, start + size)`` where ``cumulative`` exceeds the target.

    A binary search by every slot at once.  All arguments ``[M]`` but ``cumulative``
    ``[N]``, which never decreases within a segment.
    """

    def halve(_, bounds):
        low, high = bounds
        middle = (low + high) // 2
        above = cumulative[middle] > targets
        return jnp.where(above, low, jnp.minimum(middle + 1, high)), jnp.where(above, middle, high)

    steps = max(1, cumulative.shape[0].bit_length())
    return lax.fori_loop(0, steps, halve, (start, start + size - 1))[0]


def below(total: jax.Array, uniform: jax.Array) -> jax.Array:
    """``uniform * total``, kept strictly below ``total`` so that a search always ends."""
    return jnp.minimum(uniform * total, jnp.nextafter(total, jnp.zeros_like(total)))


def _ancestors_of_thresholds(offspring_before_end: jax.Array, start: jax.Array) -> jax.Array:
    """Ancestors from cumulative offspring counts: slot j takes the first k with count > j.

    ``offspring_before_end`` ``[N]`` int32 counts, within the component, the offspring of
    particles up to and including k.  Counting how many particles end at or before each
    slot avoids a search: one scatter and one running sum (O(N)).
    """
    num_particles = offspring_before_end.shape[0]
    position = start + offspring_before_end
    ending = jnp.zeros((num_particles + 1,), jnp.int32).at[position].add(1, mode="drop")
    return running_sum(ending)[:num_particles]


def _complete(counts: jax.Array, cdf: ComponentCDF) -> jax.Array:
    """Cumulative counts clipped to the component, complete where the weights end.

    Rounding of ``n * cumulative / total - u`` in float32 could leave the last slots
    without an ancestor, or give them a particle of zero weight.
    """
    counts = jnp.clip(counts.astype(jnp.int32), 0, cdf.size)
    return jnp.where(cdf.cumulative >= cdf.total, cdf.size, counts)


def _expected_offspring(cdf: ComponentCDF) -> jax.Array:
    return cdf.cumulative / cdf.total * cdf.size.astype(cdf.cumulative.dtype)


def _systematic(key, cdf):
    # One uniform per component: drawn per slot, read at the component's first slot.
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)[cdf.start]
    counts = jnp.ceil(_expected_offspring(cdf) - uniform)
    return _ancestors_of_thresholds(_complete(counts, cdf), cdf.start)


def _stratified(key, cdf):
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    expected = _expected_offspring(cdf)
    whole = jnp.floor(expected)
    stratum = cdf.start + jnp.minimum(whole.astype(jnp.int32), cdf.size - 1)
    counts = whole + (uniform[stratum] < expected - whole)
    return _ancestors_of_thresholds(_complete(counts, cdf), cdf.start)


def _multinomial(key, cdf):
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    return inverse_cdf(cdf.cumulative, below(cdf.total, uniform), cdf.start, cdf.size)


def _residual(key, cdf):
    # Liu & Chen 1998: floor(n w) copies for certain, the rest multinomial on what is left.
    num_particles = cdf.cumulative.shape[0]
    slots = jnp.arange(num_particles, dtype=jnp.int32)
    component_start = slots == cdf.start
    expected = cdf.weights / cdf.total * cdf.size.astype(cdf.weights.dtype)
    copies = jnp.floor(expected)
    certain = running_sum(copies.astype(jnp.int32), component_start)
    last = cdf.start + cdf.size - 1
    # Rounding may push the sum of the floors past n where all n w are whole numbers.
    certain = jnp.minimum(certain, cdf.size)
    from_copies = _ancestors_of_thresholds(certain, cdf.start)
    left = running_sum(jnp.maximum(expected - copies, 0.0), component_start)
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    from_rest = inverse_cdf(left, below(left[last], uniform), cdf.start, cdf.size)
    return jnp.where(slots - cdf.start < certain[last], from_copies, from_rest)


_SCHEMES = {
    "systematic": _systematic,
    "stratified": _stratified,
    "multinomial": _multinomial,
    "residual": _residual,
}
