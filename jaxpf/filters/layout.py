"""The layout of a state, a pytree, in a substate, a vector of floats."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.filters.initial import as_floats


class Leaf(NamedTuple):
    """One array of a state.

    Attributes:
        shape: its shape.
        dtype: integer or bool; None for floats.
        num_values: K, for integers 0 to K - 1 that are held as one-hot vectors, so that means of
            substates are probabilities; None holds the number itself, exact up to 2^24 in float32.
    """

    shape: tuple[int, ...]
    dtype: Any = None
    num_values: int | None = None

    @property
    def columns(self) -> tuple[int, ...]:
        """Shape of the leaf in a substate."""
        return self.shape if self.num_values is None else (*self.shape, self.num_values)


class Layout(NamedTuple):
    """Structure of the state, and its leaves; hashable.

    Substates may hold more behind the state, such as the state before.
    """

    structure: jax.tree_util.PyTreeDef
    leaves: tuple[Leaf, ...]

    @staticmethod
    def of(state: Any, num_values: Any = None, as_floats: bool = False) -> "Layout":
        """Lay out a state of given shapes and dtypes.

        Raises:
            InputError: ``num_values`` is not for integers of the state, or no positive number.
        """
        paths, structure = jax.tree_util.tree_flatten_with_path(state)
        by_name, leaves = num_values if isinstance(num_values, Mapping) else {}, []
        for path, x in paths:
            if as_floats or jnp.issubdtype(x.dtype, jnp.floating):
                leaves.append(Leaf(x.shape))
                continue
            name = jax.tree_util.keystr(path, simple=True, separator=".")
            count = by_name.get(name) if isinstance(num_values, Mapping) else num_values
            if count is not None:
                check_whole("num_values", count)
            leaves.append(Leaf(x.shape, jnp.dtype(x.dtype), count))
        of_leaves = sum(leaf.num_values is not None for leaf in leaves)
        if num_values is not None and of_leaves < max(len(by_name), 1):
            raise InputError(
                f"num_values={num_values!r:.60} is not for integers of the state; let initial and "
                "transition return integers, such as jnp.int32(0), and name their leaves."
            )
        return Layout(structure, tuple(leaves))

    @property
    def size(self) -> int:
        """Number of floats."""
        return sum(math.prod(leaf.columns) for leaf in self.leaves)

    @property
    def is_float(self) -> np.ndarray:
        """Bool ``[D]``, whether a number belongs to floats rather than to integers or bools."""
        return np.repeat(
            [leaf.dtype is None for leaf in self.leaves],
            [math.prod(leaf.columns) for leaf in self.leaves],
        )

    @property
    def is_array(self) -> bool:
        """Whether the state is a single array."""
        return jax.tree_util.treedef_is_leaf(self.structure)

    def pack(self, state: Any) -> jax.Array:
        """Flatten a state to ``[D]``."""
        parts = []
        for leaf, x in zip(self.leaves, jax.tree.leaves(state), strict=True):
            count = leaf.num_values
            parts.append(jnp.ravel(x if count is None else jax.nn.one_hot(x, count)))
        parts = [as_floats(x) for x in parts]
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts)

    def split(self, values: jax.Array) -> Any:
        """Divide columns ``[..., D]``, such as means of substates, into the state's leaves."""
        parts, first = [], 0
        for leaf in self.leaves:
            last = first + math.prod(leaf.columns)
            parts.append(values[..., first:last].reshape((*values.shape[:-1], *leaf.columns)))
            first = last
        return jax.tree.unflatten(self.structure, parts)

    def unpack(self, substates: jax.Array) -> Any:
        """Return the states ``[..., *shape]`` of substates ``[..., D]``."""

        def of_leaf(leaf: Leaf, x: jax.Array) -> jax.Array:
            x = x if leaf.num_values is None else jnp.argmax(x, axis=-1)
            return x if leaf.dtype is None else x.astype(leaf.dtype)

        parts = zip(self.leaves, jax.tree.leaves(self.split(substates)), strict=True)
        return jax.tree.unflatten(self.structure, [of_leaf(*part) for part in parts])
