"""Rows of numbers summed, picked and drawn in the form that a CPU does fastest."""

import jax
import jax.numpy as jnp


def sum_of_rows(values: jax.Array) -> jax.Array:
    """``[...]``: the sum over the last axis of ``values`` ``[..., K]``.

    A product with ones is not fused into what comes before, where a sum would be and would make
    that scalar.
    """
    return jnp.dot(values, jnp.ones(values.shape[-1], values.dtype))


def ready_to_mix(rows: jax.Array) -> jax.Array:
    """``rows`` ``[D, N]`` themselves, computed once although later rows mix them.

    Where D rows come out of a mixture of random numbers, XLA draws all of them anew for every
    one (four times slower for six rows): it fuses everything but a product of matrices.
    """
    identity = jnp.eye(rows.shape[0], dtype=rows.dtype)
    return jnp.dot(identity, rows, precision="highest")


def pick_in_rows(rows: jax.Array, columns: jax.Array) -> jax.Array:
    """``[P, N]``: the given columns, ``[N]`` or by row ``[P, N]``, of ``rows`` ``[P, N]``.

    Number by number: to move whole columns, XLA would transpose the rows twice.
    """
    return jnp.take_along_axis(rows, jnp.broadcast_to(columns, rows.shape), axis=1)


def words_at(table: jax.Array, row: jax.Array, column: jax.Array) -> jax.Array:
    """Entries of ``table`` ``[H, W]`` at rows and columns that lie within it, in their shape.

    One flat gather: two indices cost more than to multiply them.
    """
    return entries_at(table.reshape(-1), row * table.shape[1] + column)


def entries_at(rows: jax.Array, index: jax.Array) -> jax.Array:
    """``rows[index]`` for indices that are known to lie within: none is checked or wrapped."""
    return rows.at[index].get(mode="promise_in_bounds", wrap_negative_indices=False)
