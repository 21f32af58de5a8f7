"""Recognises a function that is made anew at each call, as a lambda in a loop is.

JAX compiles anew for every function object, even if its code and all values that it reads are
equal.  Functions are kept as long as JAX, or the user, keeps them, and no longer.
"""

import types
import weakref
from collections.abc import Hashable
from typing import Any

import jax
import numpy as np

#: Packages whose modules, classes and functions do not change while a program runs.
_FIXED = {"builtins", "functools", "jax", "jaxlib", "jaxpf", "math", "numpy", "scipy"}

#: Largest NumPy array that is compared by its values, bytes.
_MOST_BYTES = 2**16

_known: weakref.WeakValueDictionary[Hashable, Any] = weakref.WeakValueDictionary()
#: What each function read when it was met first, as its compiled program does.
_read: weakref.WeakKeyDictionary[Any, Hashable] = weakref.WeakKeyDictionary()


def recognised(function: Any) -> Any:
    """Return the earlier function of the same code that reads the same values, if there is one.

    Values are those of defaults, closure, attributes and global names.  A function that reads
    lists, dicts or objects, whose contents can change, is only the same as itself.
    """
    if not isinstance(function, types.FunctionType):
        return function
    try:
        return _known.setdefault(_read.setdefault(function, _key_of(function, ())), function)
    except (TypeError, ValueError):  # a value that can change, or is not there yet
        return function


def _key_of(value: Any, outer: tuple) -> Hashable:
    """Equal for values that a program cannot tell apart; ``TypeError`` if that is unknown."""
    kind = type(value)
    if kind in (type(None), bool, int, str, bytes):
        return kind, value
    if kind is float:
        return kind, value.hex()  # tells -0.0 from 0.0
    if kind is tuple:
        return kind, *(_key_of(x, outer) for x in value)
    is_small = isinstance(value, np.ndarray | np.generic) and value.nbytes <= _MOST_BYTES
    if is_small and not value.dtype.hasobject:
        return kind, value.dtype.str, value.shape, value.tobytes()
    module = value.__name__ if kind is types.ModuleType else getattr(value, "__module__", None)
    if hasattr(value, "__name__") and str(module).partition(".")[0] in _FIXED:
        return kind, _Same(value)
    if kind is types.FunctionType and value in outer:  # it calls itself
        return kind, outer.index(value)
    if kind is types.FunctionType:
        cells = (cell.cell_contents for cell in value.__closure__ or ())
        names = sorted(_names_in(value.__code__) & value.__globals__.keys())
        named = (*(value.__kwdefaults__ or {}).items(), *vars(value).items())
        looked_up = tuple((name, value.__globals__[name]) for name in names)
        read = (*cells, value.__defaults__, named, looked_up)
        return value.__code__, _key_of(read, (*outer, value))
    if isinstance(value, jax.Array) and not isinstance(value, jax.core.Tracer):
        return kind, _Same(value)
    raise TypeError(f"a {kind.__name__} can change")


class _Same:
    """Equal to the same object only, which it keeps alive."""

    def __init__(self, value: object):
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


def _names_in(code: types.CodeType) -> set[str]:
    """Names that a code and those inside it look up; some are only attributes."""
    inner = (x for x in code.co_consts if isinstance(x, types.CodeType))
    return set(code.co_names).union(*map(_names_in, inner))
