"""Control when XLA computes values: branches and barriers.

XLA fuses a computation into its users and recomputes it for every use.  That is right for a
multiplication and wrong for a likelihood.
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
    """``true()`` or ``false()``; only the chosen one is computed.

    Args:
        predicate: ``[]`` bool, the same for all runs; otherwise both are computed for every run.
        true: the computation if the predicate holds.
        false: the computation otherwise, with results of the same shapes.
        is_never_true: whether shapes alone rule out ``true``; the predicate is then ignored.
    """
    if is_never_true:
        # The barrier replaces the boundary of the branch.
        return computed_before(false())
    return lax.cond(predicate, true, false)


def computed_once(
    function: Callable[[], jax.Array], like: jax.Array, unforeseen: jax.Array
) -> jax.Array:
    """``function()``, computed once for all its uses.

    On a CPU, XLA would fuse it into each use and recompute it, even across a barrier, but not
    across a branch whose predicate is unknown at compile time.

    Args:
        function: the computation.
        like: an array of the same shape and dtype.
        unforeseen: ``[]`` bool, true at run time but unknown to the compiler.
    """
    return lax.cond(unforeseen, function, lambda: like)


def computed_before(tree: Any) -> Any:
    """Return the same tree, fully computed before anything that uses it.

    Like ``lax.optimization_barrier``, but integers and booleans get no derivative: JAX gives them
    one, for which a following ``jnp.all`` has no rule.
    """

    def cut(x):
        return x if jnp.issubdtype(x.dtype, jnp.inexact) else x | jnp.zeros_like(x)

    return jax.tree.map(cut, lax.optimization_barrier(tree))
