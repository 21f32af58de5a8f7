"""Refusals that depend on arrays: an error where they are known, NaN where they are traced."""

import dataclasses
from collections.abc import Iterable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.state import STATUS_OK, STATUS_UNSUPPORTED, Summary


def refused(*cases: tuple[Any, Iterable[Any]]) -> Any:
    """Refuse the first case that is known to hold; return whether a traced one holds.

    Args:
        cases: conditions, bool of any shape or None, each with the pieces of its ``InputError``.

    Returns:
        Bool, for ``poisoned``; None if no condition is traced.

    Raises:
        InputError: a condition that is not traced holds.
    """
    traced = None
    for condition, pieces in cases:
        if condition is None:
            continue
        if is_concrete(condition):
            if np.any(condition):
                raise InputError(*pieces)
        else:
            traced = condition if traced is None else traced | condition
    return traced


def poisoned(refused: Any, tree: Any) -> Any:
    """Replace a tree's floats by NaN, and mark its summaries, where ``refused``, ``[]`` or None."""
    if refused is None:
        return tree

    def with_nan(leaf: Any) -> Any:
        is_float = jnp.issubdtype(leaf.dtype, jnp.floating)
        return jnp.where(refused, jnp.nan, leaf).astype(leaf.dtype) if is_float else leaf

    def marked(node: Any) -> Any:
        if not isinstance(node, Summary):
            return node
        bit = jnp.where(refused, STATUS_UNSUPPORTED, STATUS_OK).astype(node.status.dtype)
        return dataclasses.replace(node, status=node.status | bit)

    tree = jax.tree.map(with_nan, tree)
    return jax.tree.map(marked, tree, is_leaf=lambda node: isinstance(node, Summary))
