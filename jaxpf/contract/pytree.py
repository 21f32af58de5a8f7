"""Frozen dataclasses that JAX sees as pytrees.

Unflattening happens inside transformations, with tracers, ``None`` or plain objects in
place of arrays.  It therefore bypasses ``__init__`` and ``__post_init__``: a class may
validate its arguments in ``__post_init__`` and the check runs once, when a user
constructs the object, never inside a transformation.
"""

import dataclasses
from typing import Any, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np

T = TypeVar("T")


def static_field(**kwargs: Any) -> Any:
    """A field that is part of the pytree's structure: hashable, and a change recompiles."""
    return dataclasses.field(metadata={"static": True}, **kwargs)


@dataclass_transform(frozen_default=True, field_specifiers=(static_field, dataclasses.field))
def pytree_dataclass(cls: type[T]) -> type[T]:
    """Make ``cls`` a frozen dataclass and register it as a pytree with named keys.

    Objects are equal if they are the same: arrays are not compared.
    """
    cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    fields = dataclasses.fields(cls)  # type: ignore[arg-type]
    data_names = tuple(f.name for f in fields if not f.metadata.get("static", False))
    static_names = tuple(f.name for f in fields if f.metadata.get("static", False))

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


def is_concrete(*values: Any) -> bool:
    """True if no leaf is a tracer, so that values (not only shapes) can be checked."""
    leaves = jax.tree_util.tree_leaves(values)
    return not any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)


def as_array(value: Any, dtype: Any = None) -> jax.Array:
    """``jnp.asarray(value, dtype)``, where NumPy converts what is not JAX's yet.

    JAX would compile a program for every new shape and type: some 20 ms each, at every start.
    """
    if isinstance(value, jax.Array) or not is_concrete(value):
        return jnp.asarray(value, dtype)
    value = np.asarray(value)
    wanted = jax.dtypes.canonicalize_dtype(value.dtype if dtype is None else dtype)
    return jax.device_put(value.astype(wanted))
