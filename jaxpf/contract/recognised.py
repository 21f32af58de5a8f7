"""Recognises a function that is made anew at each call, as a lambda in a loop is.

JAX compiles anew for every function object, even if its code and all values that it reads are
equal.
"""

import dataclasses
import functools
import itertools
import types
import warnings
import weakref
from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import jax
import numpy as np

#: Packages whose modules, classes and functions do not change while a program runs.
_FIXED = {"builtins", "chex", "functools", "jax", "jaxlib", "jaxpf", "math", "numpy", "scipy"}
#: Largest array that is compared by its values, bytes.
_MOST_BYTES = 2**16
#: From this number of functions of one code, each compiled, a warning tells the line.
_TOO_MANY = 3

_known: dict[object, Callable] = {}
#: Every function met: one is known by the values that it read at first, as JAX's program of it is.
_met: weakref.WeakSet[Callable] = weakref.WeakSet()
_made: Counter[types.CodeType] = Counter()


def recognised(name: str, function: Any) -> Any:
    """Return the earlier function that does the same, if there is one; else ``function``.

    Functions are the same if their code is, and all values that they read: defaults, closure,
    attributes and global names.  A function that reads lists, dicts or objects, whose contents can
    change, is only the same as itself.  At the third function of one code, a warning names its
    line.

    Args:
        name: of the argument, for the warning.
        function: a user's function; others than plain functions are returned as they are.
    """
    if not isinstance(function, types.FunctionType):
        return function
    code = function.__code__
    reason = "holds other values each time"
    try:
        key = _key_of(function, set())
        if key in _known:
            return _known[key]
        if function not in _met:
            _known[key] = function
    except _UnknownError as error:
        if error.is_traced:
            return function
        reason = f"reads {error}, which may change"
    if function in _met:
        return function
    _met.add(function)
    _made[code] += 1
    if _made[code] == _TOO_MANY:
        warnings.warn(
            f"{name} is made anew for each call at {code.co_filename}:{code.co_firstlineno} and "
            f"{reason}, so each call compiles again; define the function once, outside of the "
            "loop, and let it read varying values from its arguments.",
            stacklevel=3,
        )
    return function


class _UnknownError(Exception):
    """A value that cannot be compared; traced values say nothing about the calls to come."""

    is_traced = False


@dataclasses.dataclass(frozen=True, eq=False)
class _Same:
    """Equal to the same object only, which it keeps alive."""

    value: object

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


def _key_of(value: Any, seen: set[Callable]) -> Hashable:
    """A hashable key that is equal for values that a program cannot tell apart.

    Args:
        value: any value.
        seen: functions met on the way, which may call each other.
    """
    kind, of = type(value), functools.partial(_key_of, seen=seen)
    if isinstance(value, jax.core.Tracer):
        error = _UnknownError("a traced value")
        error.is_traced = True
        raise error
    if kind in (type(None), bool, int, str, bytes, type(...)):
        return kind, value
    if kind is float:
        return kind, value.hex()  # tells -0.0 from 0.0
    if kind is tuple:
        return kind, *map(of, value)
    is_small = isinstance(value, np.ndarray | np.generic) and value.nbytes <= _MOST_BYTES
    if is_small and value.dtype.kind not in "OV":
        return kind, value.dtype.str, value.shape, value.tobytes()
    is_function = kind is types.FunctionType
    if isinstance(value, jax.Array) or _is_fixed(value) or (is_function and value in seen):
        return _Same(value)
    if is_function:
        seen.add(value)
        read = {name: of(x) for name, x in _values_read_by(value)}
        return kind, value.__code__, _Same(value.__globals__), tuple(read.items())
    if kind is functools.partial:
        return kind, of(value.func), of(value.args), of(tuple(sorted(value.keywords.items())))
    if dataclasses.is_dataclass(value) and kind.__dataclass_params__.frozen:
        return _Same(kind), *(of(getattr(value, f.name)) for f in dataclasses.fields(value))
    raise _UnknownError(f"a {kind.__name__}")


def _values_read_by(function: types.FunctionType) -> Iterator[tuple[str, object]]:
    """Names and values of defaults, attributes, closure and globals."""
    yield "defaults", function.__defaults__
    yield "keywords", tuple(sorted((function.__kwdefaults__ or {}).items()))
    yield "attributes", tuple(sorted(vars(function).items()))
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # not yet assigned
            raise _UnknownError(f"{name}, which has no value yet") from None
    for name in sorted(set(_global_names(function.__code__)) & function.__globals__.keys()):
        yield f"global {name}", function.__globals__[name]


def _global_names(code: types.CodeType) -> Iterator[str]:
    """Names that a code and those inside it look up; some are only attributes."""
    inner = (x for x in code.co_consts if isinstance(x, types.CodeType))
    yield from itertools.chain(code.co_names, *map(_global_names, inner))


def _is_fixed(value: object) -> bool:
    """Whether a value belongs to a package that does not change."""
    if isinstance(value, types.ModuleType):
        return value.__name__.partition(".")[0] in _FIXED
    module = getattr(value, "__module__", None) if callable(value) else None
    named = isinstance(value, type) or hasattr(value, "__name__")
    return (
        named
        and (module or "").partition(".")[0] in _FIXED
        and "<locals>" not in (getattr(value, "__qualname__", ""))
    )
