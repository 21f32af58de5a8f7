"""Resampling schemes: draw ancestors within contiguous components.

For custom schemes see ``jaxpf.resampling``.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.errors import check_known
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.lowering import platform
from jaxpf.lowering.prefix import held, running_max, running_sum
from jaxpf.resampling.components import ComponentCDF, Components, ranks

#: Names of resampling schemes.
SCHEMES = ("systematic", "stratified", "multinomial", "residual")

#: Relative error of expected offspring, in units of the precision.
_ROUNDING = 8


@pytree_dataclass
class BuiltIn:
    """A built-in scheme, by name."""

    name: str = static_field()

    def __str__(self) -> str:
        return self.name

    def within(self, key: jax.Array, cdf: ComponentCDF, components: Components) -> jax.Array:
        """Draw each slot's ancestor, ``[N]``, within its component."""
        return _SCHEMES[self.name](key, cdf, components)


@pytree_dataclass
class Own:
    """A user's custom scheme.

    Draws ``count`` = N ancestors from each of the C components, C times the work of a built-in
    scheme, unless there is a single component.  A component of n slots uses every N/n-th of its
    draws, from a random start.  Each draw is used with probability n/N, so an unbiased scheme stays
    unbiased, and evenly spaced draws stay evenly spaced.
    """

    scheme: Any

    def within(self, key: jax.Array, cdf: ComponentCDF, components: Components) -> jax.Array:
        """See ``BuiltIn``."""
        num, count = cdf.weights.shape[0], components.size.shape[0]
        log_weights = jnp.log(cdf.weights) - components.spread(
            jnp.log(jnp.where(cdf.total > 0, cdf.total, 1.0))
        )
        log_weights = lax.stop_gradient(log_weights)
        start, size = components.spread(components.start), components.spread(components.size)

        def of_all():
            return self.scheme(key, log_weights, num).astype(jnp.int32)

        def of_each():
            draw_key, place_key = jax.random.split(key)

            def of_one(key, component):
                # An empty component's draws are not used.
                is_empty = components.size[component] == 0
                mine = (components.index == component) | is_empty
                drawn = self.scheme(key, jnp.where(mine, log_weights, -jnp.inf), num)
                return drawn.astype(jnp.int32)

            keys = jax.random.split(draw_key, count)
            drawn = jax.vmap(of_one)(keys, jnp.arange(count))
            slot = jnp.arange(num, dtype=jnp.int32) - start
            offset = components.spread(jax.random.uniform(place_key, (count,)))
            place = jnp.floor((slot + offset) * (num / size)).astype(jnp.int32)
            return drawn[components.index, jnp.clip(place, 0, num - 1)]

        chosen = of_all() if count == 1 else lax.cond(components.size[0] == num, of_all, of_each)
        # Rounding may carry a search past the end.
        return jnp.clip(chosen, start, start + size - 1)


def scheme_of(given: object) -> BuiltIn | Own:
    """Return a scheme from a name or a custom scheme."""
    if isinstance(given, BuiltIn | Own):
        return given
    if isinstance(given, str):
        check_known("resampling=", given, SCHEMES)
        return BuiltIn(given)
    return Own(given)


def inverse_cdf(
    cumulative: jax.Array, targets: jax.Array, start: jax.Array, size: jax.Array
) -> jax.Array:
    """First position in ``[start, start + size)`` where ``cumulative`` exceeds the target.

    Vectorised binary search.  All arguments are ``[M]`` except ``cumulative`` ``[N]``, which is
    non-decreasing within a segment.
    """
    num_particles = cumulative.shape[0]
    steps = num_particles.bit_length()

    # Halving strides carries one bound without division: a tenth of the time of two bounds.
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
    """Ancestors from cumulative offspring counts: slot j takes the first particle k with end > j.

    ``end`` ``[N]`` int32, non-decreasing, counts the offspring of particles up to and including k.
    Counting the particles that end at or before each slot avoids a search: one scatter and one
    running sum (O(N)).
    """
    return running_sum(jnp.zeros(end.shape, jnp.int32).at[end].add(1, mode="drop"))


def _ancestors(counts, cdf, components) -> jax.Array:
    """Ancestors from cumulative offspring counts ``[N]`` within each component.

    A particle of zero weight gets no slot, and slots that float32 rounding of
    ``n * cumulative / total - u`` leaves over go to the last particle before them.
    """
    start, size = components.spread(components.start), components.spread(components.size)
    counts = jnp.clip(counts.astype(jnp.int32), 0, size)
    if not platform.on_accelerator():
        is_last = cdf.cumulative >= components.spread(cdf.total)
        return ancestors_of_thresholds(start + jnp.where(is_last, size, counts))
    # Counts may vary across zero weights: a slot's ancestor is the last particle to begin there.
    end, particle = start + counts, jnp.arange(counts.shape[0], dtype=jnp.int32)
    begin = jnp.maximum(jnp.roll(end, 1).at[0].set(0), start)
    first = jnp.where((cdf.weights > 0) & (end > begin), begin, end.shape[0])
    return running_max(jnp.full_like(particle, -1).at[first].max(particle, mode="drop"))


def _expected(values, total, components) -> jax.Array:
    """``n_c * values / total_c``: expected offspring, or their running sums."""
    return values * components.spread(components.size.astype(values.dtype) / total)


def _systematic(key, cdf, components):
    uniform = jax.random.uniform(key, components.size.shape, cdf.cumulative.dtype)
    expected = _expected(cdf.cumulative, cdf.total, components)
    return _ancestors(jnp.ceil(expected - components.spread(uniform)), cdf, components)


def _stratified(key, cdf, components):
    uniform = jax.random.uniform(key, cdf.cumulative.shape, cdf.cumulative.dtype)
    expected = _expected(cdf.cumulative, cdf.total, components)
    whole = jnp.floor(expected)
    start, size = components.spread(components.start), components.spread(components.size)
    stratum = start + jnp.minimum(whole.astype(jnp.int32), size - 1)
    counts = whole + (uniform[stratum] < expected - whole)
    return _ancestors(counts, cdf, components)


def _multinomial(key, cdf, components):
    cumulative = held(cdf.cumulative, cdf.weights, ranks(components))
    uniform = jax.random.uniform(key, cumulative.shape, cumulative.dtype)
    targets = below(components.spread(components.last_of(cumulative)), uniform)
    start, size = components.spread(components.start), components.spread(components.size)
    return inverse_cdf(cumulative, targets, start, size)


def _residual(key, cdf, components):
    # Liu & Chen 1998: floor(n w) deterministic copies, the rest multinomial on the residuals.
    start, size = components.spread(components.start), components.spread(components.size)
    rank = ranks(components)
    expected = _expected(cdf.weights, cdf.total, components)
    # Rounding, which differs between platforms, must not cost a particle its whole copies.
    copies = jnp.floor(expected * (1 + _ROUNDING * jnp.finfo(expected.dtype).eps))
    # Rounding may push the sum of the floors past n if all n w are integers.
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
