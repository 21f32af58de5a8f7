"""Sums, gathers and draws of rows, in the form that is fastest on a CPU."""

import jax
import jax.numpy as jnp


def sum_of_rows(values: jax.Array) -> jax.Array:
    """``[...]``: the sum over the last axis of ``values`` ``[..., K]``, as a product with ones.

    XLA would fuse a sum into the preceding computation, which then would not vectorise.
    """
    return jnp.dot(values, jnp.ones(values.shape[-1], values.dtype))


def ready_to_mix(rows: jax.Array) -> jax.Array:
    """Return ``rows`` ``[D, N]``, computed once even if later rows mix them.

    If D rows are mixtures of random numbers, XLA redraws all numbers for every row (four times
    slower for six rows): it fuses everything except matrix products.
    """
    identity = jnp.eye(rows.shape[0], dtype=rows.dtype)
    return jnp.dot(identity, rows, precision="highest")


def pick_in_rows(rows: jax.Array, columns: jax.Array) -> jax.Array:
    """``[P, N]``: the given columns, ``[N]`` or per row ``[P, N]``, of ``rows`` ``[P, N]``.

    Gathers single numbers: to gather whole columns, XLA would transpose the rows twice.
    """
    return jnp.take_along_axis(rows, jnp.broadcast_to(columns, rows.shape), axis=1)


def words_at(table: jax.Array, row: jax.Array, column: jax.Array) -> jax.Array:
    """Entries of ``table`` ``[H, W]`` at in-range rows and columns, in the shape of these.

    One flat gather: computing a flat index is cheaper than gathering with two indices.
    """
    return entries_at(table.reshape(-1), row * table.shape[1] + column)


def entries_at(rows: jax.Array, index: jax.Array) -> jax.Array:
    """``rows[index]`` for indices known to be in range: none is checked or wrapped."""
    return rows.at[index].get(mode="promise_in_bounds", wrap_negative_indices=False)
