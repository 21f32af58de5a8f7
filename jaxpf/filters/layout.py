"""The layout of a state, a pytree, in a substate, a vector of floats."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import is_concrete
from jaxpf.filters.initial import as_floats


class Leaf(NamedTuple):
    """One array of a state.

    Attributes:
        shape: its shape.
        dtype: integer or bool; None for floats.
        num_values: K, for integers 0 to K - 1 that are held as one-hot vectors, so that means of
            substates are probabilities; an integer outside is held as zeros.  None holds the number
            itself.
    """

    shape: tuple[int, ...]
    dtype: Any = None
    num_values: int | None = None

    @property
    def columns(self) -> tuple[int, ...]:
        """Shape of the leaf's values in a substate."""
        return self.shape if self.num_values is None else (*self.shape, self.num_values)

    @property
    def remainder(self) -> Any:
        """Signed dtype of what rounding to a float leaves of an integer; None if nothing is left.

        A float32 holds integers up to 2^24 only, so that larger ones need a second number.
        """
        if self.dtype is None or self.num_values is not None or self.dtype.itemsize <= 2:
            return None
        return jnp.dtype(f"int{8 * self.dtype.itemsize}")


class Layout(NamedTuple):
    """Structure of the state, and its leaves; hashable.

    A substate holds the values of all leaves, then the remainders of integers; with two ``copies``
    the state before follows.
    """

    structure: jax.tree_util.PyTreeDef
    leaves: tuple[Leaf, ...]
    copies: int = 1

    @staticmethod
    def of(state: Any, num_values: Any = None) -> "Layout":
        """Lay out a state of given shapes and dtypes.

        Raises:
            InputError: ``num_values`` is not for integers of the state, or no positive number.
        """
        paths, structure = jax.tree_util.tree_flatten_with_path(state)
        by_name, leaves = num_values if isinstance(num_values, Mapping) else {}, []
        for path, x in paths:
            if jnp.issubdtype(x.dtype, jnp.floating):
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
        """Number of floats of one state."""
        remainders = sum(math.prod(leaf.shape) for leaf in self.leaves if leaf.remainder)
        return self.num_values + remainders

    @property
    def num_values(self) -> int:
        """Number of floats without the remainders."""
        return sum(math.prod(leaf.columns) for leaf in self.leaves)

    @property
    def is_float(self) -> np.ndarray:
        """Bool ``[D]``, whether a number belongs to floats rather than to integers or bools."""
        values = np.repeat(
            [leaf.dtype is None for leaf in self.leaves],
            [math.prod(leaf.columns) for leaf in self.leaves],
        )
        return np.concatenate([values, np.zeros(self.size - self.num_values, bool)])

    @property
    def is_array(self) -> bool:
        """Whether the state is a single array."""
        return jax.tree_util.treedef_is_leaf(self.structure)

    def arrays(self, state: Any) -> Any:
        """A state that is given by its values, such as a list, in arrays of the leaves' kinds.

        NumPy holds what is no JAX array, so that its precision is chosen at the run.
        """
        leaves = [state] if self.is_array else jax.tree.leaves(state)
        kept = (isinstance(x, jax.Array) or not is_concrete(x) for x in leaves)
        arrays = [(jnp if k else np).asarray(x) for k, x in zip(kept, leaves, strict=True)]
        kinds = zip(self.leaves, arrays, strict=True)
        floats = [as_floats(x) if leaf.dtype is None else x for leaf, x in kinds]
        return jax.tree.unflatten(self.structure, floats)

    def pack(self, state: Any) -> jax.Array:
        """Flatten a state to ``[D]``."""
        values, remainders = [], []
        leaves = self.structure.flatten_up_to(state)
        for leaf, x in zip(self.leaves, map(jnp.ravel, leaves), strict=True):
            count = leaf.num_values
            value = as_floats(x if count is None else jnp.ravel(jax.nn.one_hot(x, count)))
            values.append(value)
            if leaf.remainder:
                x = x.astype(leaf.dtype)
                # Wraps around as integers do, also where the float exceeds the largest integer.
                rest = (x - value.astype(leaf.dtype)).astype(leaf.remainder)
                remainders.append(rest.astype(value.dtype))
        parts = values + remainders
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts)

    def split(self, values: jax.Array) -> Any:
        """Divide columns ``[..., D]``, such as means of substates, into the state's leaves.

        Integers without ``num_values`` are the nearest floats.
        """
        parts, first = [], 0
        for leaf in self.leaves:
            last = first + math.prod(leaf.columns)
            parts.append(values[..., first:last].reshape((*values.shape[:-1], *leaf.columns)))
            first = last
        return jax.tree.unflatten(self.structure, parts)

    def unpack(self, substates: jax.Array) -> Any:
        """Return the states ``[..., *shape]`` of substates ``[..., D]``."""
        parts, first = [], self.num_values
        for leaf, x in zip(self.leaves, jax.tree.leaves(self.split(substates)), strict=True):
            if leaf.num_values is not None:
                # Stays outside until the model moves it back.
                x = jnp.where(jnp.any(x > 0, axis=-1), jnp.argmax(x, axis=-1), leaf.num_values)
            x = x if leaf.dtype is None else x.astype(leaf.dtype)
            if leaf.remainder:
                last = first + math.prod(leaf.shape)
                rest = substates[..., first:last].reshape(x.shape).astype(leaf.remainder)
                x, first = x + rest.astype(leaf.dtype), last
            parts.append(x)
        return jax.tree.unflatten(self.structure, parts)

    def is_outside(self, state: Any) -> Any:
        """Whether an integer of a state is not one of its ``num_values``."""
        leaves = zip(self.leaves, jax.tree.leaves(state), strict=True)
        outside = [
            ((x < 0) | (x >= leaf.num_values)).any() for leaf, x in leaves if leaf.num_values
        ]
        return sum(outside, start=False)


def at_least_single(dtype: Any) -> Any:
    """The dtype of a number; half precision cannot separate particles."""
    is_float = jnp.issubdtype(dtype, jnp.floating)
    return jnp.promote_types(dtype, jnp.float32) if is_float else dtype
