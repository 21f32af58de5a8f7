"""Control when XLA computes values: branches and barriers.

XLA fuses a computation into its users and recomputes it for every use.  That is right for a
multiplication and wrong for a likelihood.

A branch keeps XLA from computing more than is needed.  On an accelerator it costs as much as a few
small kernels, as the predicate must reach the host first; there, cheap results are selected.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.lowering import platform


def choose(
    predicate: jax.Array,
    true: Callable[[], Any],
    false: Callable[[], Any],
    *,
    is_never_true: bool = False,
    cheap: bool = False,
) -> Any:
    """``true()`` or ``false()``; only the chosen one is computed.

    Args:
        predicate: ``[]`` bool, the same for all runs; otherwise both are computed for every run.
        true: the computation if the predicate holds.
        false: the computation otherwise, with results of the same shapes.
        is_never_true: whether shapes alone rule out ``true``; the predicate is then ignored.
        cheap: whether both take less time than a branch on an accelerator, which computes both.
    """
    if is_never_true:
        # The barrier replaces the boundary of the branch.
        return computed_before(false())
    if cheap and platform.on_accelerator():
        return jax.tree.map(partial(jnp.where, predicate), true(), false())
    return lax.cond(predicate, true, false)


def computed_once(
    function: Callable[[], jax.Array], like: jax.Array, unforeseen: jax.Array
) -> jax.Array:
    """``function()``, computed once for all its uses; ``like`` is an array of the same form.

    On a CPU, XLA would fuse it into each use and recompute it, even across a barrier, but not
    across a branch whose predicate is unknown at compile time, such as ``unforeseen``, which is
    true at run time.  On an accelerator a barrier is enough.
    """
    if platform.on_accelerator():
        return lax.optimization_barrier(function())
    return lax.cond(unforeseen, function, lambda: like)


def repeated(count: int, body: Callable[[jax.Array, Any], Any], carry: Any) -> Any:
    """``lax.fori_loop(0, count, body, carry)``; on an accelerator, a single turn without a loop."""
    if count == 1 and platform.on_accelerator():
        return body(jnp.zeros((), jnp.int32), carry)
    return lax.fori_loop(0, count, body, carry)


def computed_before(tree: Any) -> Any:
    """Return the same tree, on a CPU fully computed before anything that uses it.

    Like ``lax.optimization_barrier``, but integers and booleans get no derivative: JAX gives them
    one, for which a following ``jnp.all`` has no rule.  On an accelerator XLA keeps what is long to
    compute by itself, and a barrier costs passes through memory.
    """
    if platform.on_accelerator():
        return tree

    def cut(x):
        return x if jnp.issubdtype(x.dtype, jnp.inexact) else x | jnp.zeros_like(x)

    # Each leaf apart: with a common barrier, what nothing uses would be computed too.
    return jax.tree.map(lambda x: cut(lax.optimization_barrier(x)), tree)


def one_by_one(function: Callable) -> Callable:
    """The same function; on a CPU, ``vmap`` evaluates it for one item after the other.

    For much work per item: the same program, and so the same bits, however many items go together,
    in less memory.  The result has no derivative.
    """

    def without_derivative(*arguments: Any) -> Any:
        return lax.stop_gradient(function(*lax.stop_gradient(arguments)))

    if platform.on_accelerator():
        return without_derivative
    return jax.custom_batching.sequential_vmap(without_derivative)
