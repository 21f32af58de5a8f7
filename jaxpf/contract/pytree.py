"""Frozen dataclasses that JAX sees as pytrees.

JAX unflattens inside transformations, with tracers, ``None`` or plain objects in place of
arrays.  Unflattening therefore bypasses ``__init__`` and ``__post_init__``.  A class can
validate its arguments in ``__post_init__``: the check runs once, when a user constructs the
object, never inside a transformation.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike

from jaxpf.lowering.programs import compiled, in_full

T = TypeVar("T")

#: What ``jax.jit`` takes as an array.
_ARRAYS = jax.Array | np.ndarray | np.generic | int | float | complex


def static_field(**kwargs: Any) -> Any:
    """A field that is part of the pytree's structure: hashable; a new value recompiles."""
    return dataclasses.field(metadata={"static": True}, **kwargs)


@dataclass_transform(frozen_default=True, field_specifiers=(static_field, dataclasses.field))
def pytree_dataclass(cls: type[T]) -> type[T]:
    """Make ``cls`` a frozen dataclass and register it as a pytree with named keys.

    Equality is identity: arrays are not compared.  Functions in its fields become static, see
    ``with_static_functions``.

    Example::

        @jaxpf.pytree_dataclass
        class Drift:
            scale: float

            def propagate(self, key, partition, current, previous, parent):
                return current + self.scale * jax.random.normal(key, current.shape)

    Returns:
        The dataclass.
    """
    is_made = "__init__" not in vars(cls)
    cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    fields = dataclasses.fields(cls)  # type: ignore[arg-type]
    data_names = tuple(f.name for f in fields if not f.metadata.get("static", False))
    static_names = tuple(f.name for f in fields if f.metadata.get("static", False))
    construct = cls.__init__

    @functools.wraps(construct)
    def constructor(self, *values, **named):
        construct(self, *values, **named)
        for name in data_names:
            value = getattr(self, name)
            if (changed := with_static_functions(value)) is not value:
                object.__setattr__(self, name, changed)

    if is_made:
        cls.__init__ = constructor  # type: ignore[method-assign]

    def flatten_with_keys(node):
        children = [(jax.tree_util.GetAttrKey(name), getattr(node, name)) for name in data_names]
        return children, tuple(getattr(node, name) for name in static_names)

    def flatten(node):
        children = [getattr(node, name) for name in data_names]
        return children, tuple(getattr(node, name) for name in static_names)

    def unflatten(static_values, children):
        node = object.__new__(cls)
        for name, value in zip(static_names, static_values, strict=True):
            object.__setattr__(node, name, value)
        for name, value in zip(data_names, children, strict=True):
            object.__setattr__(node, name, value)
        return node

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    return cls


def with_static_functions(tree: T) -> T:
    """Wrap functions among a pytree's leaves, such as a network's activations, by ``Partial``.

    So they belong to its structure, as static fields do, and can still be called.
    """
    if not any(map(callable, jax.tree.leaves(tree))):
        return tree
    return jax.tree.map(lambda x: jax.tree_util.Partial(x) if callable(x) else x, tree)


def is_concrete(*values: object) -> bool:
    """Whether no leaf is a tracer, so that values can be checked, not only shapes."""
    leaves = jax.tree_util.tree_leaves(values)
    return not any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)


def compiled_alone(method: Callable) -> Callable:
    """Compile a tracker's method: called outside of ``jit``, it costs what it costs inside.

    All trackers of one structure share a program, as the tracker is an argument.  A call with
    traced values, or of a class that is no pytree of arrays, runs the method as it is.
    """
    # Inlined, a call without traced values in a user's program is the same program as without jit.
    program, traced = compiled(method, inline=True), in_full(method)

    @functools.wraps(method)
    def call(*arguments, **named):
        leaves = jax.tree.leaves((arguments, named))
        plain = is_concrete(leaves) and all(isinstance(leaf, _ARRAYS) for leaf in leaves)
        return (program if plain else traced)(*arguments, **named)

    return call


def as_array(value: Any, dtype: DTypeLike | None = None) -> jax.Array:
    """``jnp.asarray(value, dtype)``, but NumPy converts values that are not JAX arrays.

    JAX would compile a conversion for every new shape and dtype, about 20 ms each in every process.
    A value that is known stays known inside a user's trace, so that it can be checked there.
    """
    if isinstance(value, jax.Array) or not is_concrete(value):
        return jnp.asarray(value, dtype)
    value = np.asarray(value)
    wanted = jax.dtypes.canonicalize_dtype(value.dtype if dtype is None else dtype)
    with jax.ensure_compile_time_eval():
        return jax.device_put(value.astype(wanted))
