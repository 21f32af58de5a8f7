"""What is computed when: branches, and what is to be ready before something else begins.

XLA merges a computation into whatever uses it, and computes it there again for every use.  That
is right for a multiplication and wrong for a likelihood.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax


def choose(
    predicate: jax.Array,
    true: Callable[[], Any],
    false: Callable[[], Any],
    *,
    is_never_true: bool = False,
) -> Any:
    """``true()`` or ``false()``, of which only the one that is chosen is computed.

    Args:
        predicate: ``[]`` bool, the same for all runs, or both are computed for every run.
        true: what is wanted where the predicate holds.
        false: what is wanted elsewhere, of the same shapes.
        is_never_true: known from shapes alone; the predicate is then ignored.
    """
    if is_never_true:
        # The barrier stands in for the branch's edge.
        return computed_before(false())
    return lax.cond(predicate, true, false)


def computed_once(
    function: Callable[[], jax.Array], like: jax.Array, unforeseen: jax.Array
) -> jax.Array:
    """``function()``, computed once, however many things use it.

    On a CPU, XLA would rather merge it into each of its uses and compute it there again, past
    any barrier; but not past the edge of a branch that it cannot foresee.

    Args:
        function: what is computed.
        like: an array of the same shape and dtype.
        unforeseen: ``[]`` bool, true, but so that the compiler cannot know.
    """
    return lax.cond(unforeseen, function, lambda: like)


def computed_before(tree: Any) -> Any:
    """The same tree, all of it computed before anything that uses it begins.

    ``lax.optimization_barrier`` whose integers and truth values have no derivative: JAX's own
    gives them one, which the next ``jnp.all`` has no rule for.
    """

    def cut(x):
        return x if jnp.issubdtype(x.dtype, jnp.inexact) else x | jnp.zeros_like(x)

    return jax.tree.map(cut, lax.optimization_barrier(tree))
