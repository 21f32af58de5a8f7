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
from jax.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.lowering.derivatives import weighted, with_gradient_of
from jaxpf.lowering.prefix import running_max, running_sum
from jaxpf.names import SCHEMES
from jaxpf.pytree import pytree_dataclass


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

    def spread(self, values: jax.Array) -> jax.Array:
        """Give every slot its component's entry of ``values`` ``[C]``: ``[N]``."""
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
    largest: jax.Array | None = None,
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
        largest: ``[C]``, the largest ``log_selection`` of each component, where it is known.

    Returns:
        Ancestors ``[N]`` int32 and the new log-weights ``[N]``.
    """
    check_scheme(scheme)
    num_particles = log_weights.shape[0]
    if components is None:
        components = one_component(num_particles)
    by_weight = log_selection is log_weights
    log_selection = jnp.where(jnp.isnan(log_selection), -jnp.inf, log_selection)
    cdf = component_cdf(log_selection, components, largest)
    alive = components.spread(cdf.alive)
    chosen = _SCHEMES[scheme](key, cdf, components)
    chosen = jnp.where(alive, chosen, jnp.arange(num_particles, dtype=jnp.int32))
    new_log_weights = components.spread(cdf.log_mean)
    if not by_weight:
        selectable = ~jnp.isneginf(log_selection)
        correction = jnp.where(selectable, log_weights - log_selection, 0.0)
        new_log_weights += correction[chosen]
    return chosen, jnp.where(alive, new_log_weights, log_weights)


def soft_selection(log_weights: jax.Array, share: ArrayLike, components: Components) -> jax.Array:
    """Log of the mixture ``share * rho + (1 - share) / n`` of weights and uniform, ``[N]``.

    Selecting by it and reweighting keeps a derivative (Karkus, Hsu & Lee 2018, "soft
    resampling").  A component whose weights are all zero is left so.
    """
    cdf = component_cdf(log_weights, components)
    alive, part = components.spread(cdf.alive), jnp.asarray(share, log_weights.dtype)
    # Relative to the component's mean weight, the uniform law is 1.
    relative = log_weights - components.spread(jnp.where(cdf.alive, cdf.log_mean, 0.0))
    relative = jnp.where(alive, relative, 0.0)
    rest = jnp.log1p(-jnp.minimum(part, 1 - jnp.finfo(part.dtype).eps))
    mixed = jnp.logaddexp(jnp.log(part) + relative, rest)
    return jnp.where(alive, mixed, -jnp.inf)


def keep_total(log_weights: jax.Array, before: jax.Array, components: Components) -> jax.Array:
    """Give a component's new weights ``[N]`` the derivative of their total ``before``.

    Their own total has the right expectation, but not its derivative.  Values are unchanged.
    """
    change = component_cdf(before, components).log_mean
    change -= component_cdf(log_weights, components).log_mean
    return with_gradient_of(log_weights, components.spread(change))


@pytree_dataclass
class ComponentCDF:
    """The cumulative distribution of each component.

    Attributes:
        weights: ``[N]``, scaled so that the largest of each component is 1.
        cumulative: ``[N]``, running sum of ``weights`` within the component.
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
    """Cumulative weights within each component, each scaled by its own largest weight.

    Only ``log_mean`` is differentiated; the rest serves draws, which are not.
    """
    differentiated, log_weights = log_weights, lax.stop_gradient(log_weights)
    if largest is None:
        largest = component_max(log_weights, components)
    alive = ~jnp.isneginf(largest)
    reference = components.spread(jnp.where(alive, largest, 0.0))
    relative = jnp.where(components.spread(alive), log_weights - reference, 0.0)
    weights = jnp.exp(relative)
    cumulative = running_sum(weights, _ranks(components))
    total = components.last_of(cumulative)
    size = jnp.maximum(components.size, 1).astype(weights.dtype)
    log_mean = jnp.where(alive, largest + jnp.log(total) - jnp.log(size), -jnp.inf)
    share = weights / components.spread(jnp.where(total > 0, total, 1.0))
    share = jnp.where(components.spread(alive), share, 0.0)
    log_mean = with_gradient_of(log_mean, components.sum_of(weighted(share, differentiated)))
    return ComponentCDF(weights, cumulative, total, alive, log_mean)


def renormalised(log_weights: jax.Array, components: Components) -> jax.Array:
    """smith2004's literal reassembly: every component's weights sum to its share n_c / N."""
    cdf = component_cdf(log_weights, components)
    mean = components.spread(jnp.where(cdf.alive, cdf.log_mean, 0.0))
    scaled = jnp.where(components.spread(cdf.alive), log_weights - mean, -jnp.inf)
    return scaled - jax.nn.logsumexp(scaled)


def component_max(values: jax.Array, components: Components) -> jax.Array:
    """``[C]``: the largest of ``values`` ``[N]`` in each component; -inf in an empty one.

    It is not differentiated.
    """
    values = lax.stop_gradient(values)
    if components.size.shape[0] == 1:
        return jnp.max(values)[None]

    def of_each():
        largest = components.last_of(running_max(values, _ranks(components)))
        return jnp.where(components.size > 0, largest, -jnp.inf)

    def of_all():
        return jnp.full(components.size.shape, -jnp.inf, values.dtype).at[0].set(jnp.max(values))

    # Shared by all runs, but for components that particles keep: only the branch taken is computed.
    return lax.cond(components.size[0] == values.shape[0], of_all, of_each)


def _ranks(components: Components) -> jax.Array | None:
    """Place of each slot in its component; None where the shape alone says there is one."""
    if components.size.shape[0] == 1:
        return None
    slots = jnp.arange(components.index.shape[0], dtype=jnp.int32)
    return slots - components.spread(components.start)


def few_effective(
    log_weights: jax.Array, components: Components, threshold: jax.Array
) -> jax.Array:
    """``[C]`` bool: the component's effective sample size is <= threshold * n_c."""
    cdf = component_cdf(log_weights, components)
    squares = components.last_of(running_sum(cdf.weights**2, _ranks(components)))
    return cdf.total**2 <= threshold * components.size.astype(squares.dtype) * squares


def inverse_cdf(
    cumulative: jax.Array, targets: jax.Array, start: jax.Array, size: jax.Array
) -> jax.Array:
    """First position in ``[start, start + size)`` where ``cumulative`` exceeds the target.

    A binary search by every slot at once.  All arguments ``[M]`` but ``cumulative``
    ``[N]``, which never decreases within a segment.
    """
    num_particles = cumulative.shape[0]
    steps = num_particles.bit_length()

    # By halving strides: one bound to carry and no division, a tenth of the time of two.
    def advance(step, passed):
        ahead = passed + jnp.left_shift(1, steps - 1 - step)
        value = cumulative[jnp.clip(start + ahead - 1, 0, num_particles - 1)]
        return jnp.where((ahead <= size) & (value <= targets), ahead, passed)

    passed = lax.fori_loop(0, steps, advance, jnp.zeros_like(start))
    return start + jnp.minimum(passed, size - 1)


def below(total: jax.Array, uniform: jax.Array) -> jax.Array:
    """``uniform * total``, kept strictly below ``total`` so that a search always ends."""
    return jnp.minimum(uniform * total, jnp.nextafter(total, jnp.zeros_like(total)))


def ancestors_of_thresholds(end: jax.Array) -> jax.Array:
    """Ancestors from where offspring end: slot j takes the first particle k with end > j.

    ``end`` ``[N]`` int32, never decreasing, counts the offspring of particles up to and
    including k.  Counting how many particles end at or before each slot avoids a search: one
    scatter and one running sum (O(N)).
    """
    return running_sum(jnp.zeros(end.shape, jnp.int32).at[end].add(1, mode="drop"))


def _complete(counts, cumulative, total, components) -> jax.Array:
    """Cumulative counts clipped to the component, complete where the weights end.

    Rounding of ``n * cumulative / total - u`` in float32 could leave the last slots
    without an ancestor, or give them a particle of zero weight.
    """
    size = components.spread(components.size)
    counts = jnp.clip(counts.astype(jnp.int32), 0, size)
    return jnp.where(cumulative >= components.spread(total), size, counts)


def _expected(values, total, components) -> jax.Array:
    """``n_c * values / total_c``: offspring expected, or running counts of them."""
    return values * components.spread(components.size.astype(values.dtype) / total)


def _systematic(key, cdf, components):
    uniform = jax.random.uniform(key, components.size.shape, cdf.cumulative.dtype)
    expected = _expected(cdf.cumulative, cdf.total, components)
    counts = jnp.ceil(expected - components.spread(uniform))
    start = components.spread(components.start)
    return ancestors_of_thresholds(start + _complete(counts, cdf.cumulative, cdf.total, components))


def _stratified(key, cdf, components):
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    expected = _expected(cdf.cumulative, cdf.total, components)
    whole = jnp.floor(expected)
    start, size = components.spread(components.start), components.spread(components.size)
    stratum = start + jnp.minimum(whole.astype(jnp.int32), size - 1)
    counts = whole + (uniform[stratum] < expected - whole)
    return ancestors_of_thresholds(start + _complete(counts, cdf.cumulative, cdf.total, components))


def _multinomial(key, cdf, components):
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    targets = below(components.spread(cdf.total), uniform)
    start, size = components.spread(components.start), components.spread(components.size)
    return inverse_cdf(cdf.cumulative, targets, start, size)


def _residual(key, cdf, components):
    # Liu & Chen 1998: floor(n w) copies for certain, the rest multinomial on what is left.
    start, size = components.spread(components.start), components.spread(components.size)
    rank = _ranks(components)
    expected = _expected(cdf.weights, cdf.total, components)
    copies = jnp.floor(expected)
    # Rounding may push the sum of the floors past n where all n w are whole numbers.
    certain = jnp.minimum(running_sum(copies.astype(jnp.int32), rank), size)
    from_copies = ancestors_of_thresholds(start + certain)
    left = running_sum(jnp.maximum(expected - copies, 0.0), rank)
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    targets = below(components.spread(components.last_of(left)), uniform)
    from_rest = inverse_cdf(left, targets, start, size)
    slot = jnp.arange(start.shape[0], dtype=jnp.int32) - start
    num_certain = components.spread(components.last_of(certain))
    return jnp.where(slot < num_certain, from_copies, from_rest)


_SCHEMES = {
    "systematic": _systematic,
    "stratified": _stratified,
    "multinomial": _multinomial,
    "residual": _residual,
}
