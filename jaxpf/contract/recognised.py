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
        return _known.setdefault(_read.setdefault(function, _key_of(function)), function)
    except (TypeError, ValueError, RecursionError):  # a value that can change, or is not there yet
        return function


def _key_of(value: Any) -> Hashable:
    """Equal for values that a program cannot tell apart; ``TypeError`` if that is unknown."""
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return type(value), repr(value)  # tells 1 from 1.0 and True, and -0.0 from 0.0
    if type(value) is tuple:
        return tuple(map(_key_of, value))
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.hasobject or value.nbytes > _MOST_BYTES:
            raise TypeError("an array can change")
        return type(value), value.dtype.str, value.shape, value.tobytes()
    is_module = isinstance(value, types.ModuleType)
    home = value.__name__ if is_module else getattr(value, "__module__", None)
    is_fixed = hasattr(value, "__name__") and str(home).partition(".")[0] in _FIXED
    if is_fixed or (isinstance(value, jax.Array) and not isinstance(value, jax.core.Tracer)):
        return type(value), _Same(value)
    if isinstance(value, types.FunctionType):
        cells = tuple(cell.cell_contents for cell in value.__closure__ or ())
        names = sorted(_names_in(value.__code__) & value.__globals__.keys())
        named = *vars(value).items(), *(value.__kwdefaults__ or {}).items()
        looked_up = tuple(value.__globals__[name] for name in names)
        return value.__code__, _key_of((cells, value.__defaults__, named, looked_up))
    raise TypeError(f"a {type(value).__name__} can change")


class _Same:
    """Equal to the same object only, which it keeps alive, so that no other gets its address."""

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
