"""Checks of the plain functions of a state-space model, and their calls."""

import inspect
import re
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import returned
from jaxpf.contract.pytree import is_concrete
from jaxpf.filters.initial import checked_initial
from jaxpf.filters.layout import Layout


def extras_of(
    function: Callable, frame: dict[str, Any] | None, previous: Callable[[], Any]
) -> dict[str, Any]:
    """Collect the arguments that a function asks for by name.

    Args:
        function: the user's.
        frame: ``time`` and ``u`` of the frame, as far as known.
        previous: computes the state before the current one, which smoothing must not see in use.
    """
    extras = {name: value for name, value in (frame or {}).items() if asks_for(function, name)}
    if asks_for(function, "previous"):
        extras["previous"] = previous()
    if "time" not in extras and asks_for(function, "time"):
        raise InputError(
            "the model asks for the time of a frame, which step does not know; use "
            "jaxpf.run, or step jaxpf.contract.at_frame(tracker, time)."
        )
    if "u" not in extras and asks_for(function, "u"):
        raise InputError(
            "the model asks for a known input u; give inputs=, arrays with a row for each frame."
        )
    return extras


#: What JAX raises where a function needs the value of a traced array.
_NEEDS_VALUES = (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError)


def call(name: str, function: Callable, *arguments: Any, **extras: Any) -> Any:
    """Call a user's function, its parameters last; say what it lacks: values, or parameters."""
    try:
        return function(*arguments, **extras)
    except _NEEDS_VALUES as error:
        problem = "converts an array by float(x), int(x) or x.item(); leave that out"
        if isinstance(error, jax.errors.TracerBoolConversionError):
            problem = "decides by an array in a Python if, and, or, min or max; use jnp.where"
        elif isinstance(error, jax.errors.TracerArrayConversionError):
            problem = "calls NumPy on an array; use jax.numpy, such as jnp.sin for np.sin"
        raise InputError(
            f"{name} ({getattr(function, '__name__', function)}) {problem}, as JAX compiles it."
        ) from error
    except TypeError as error:
        if arguments[-1] is None and "'NoneType'" in str(error):
            raise InputError(f"{name} reads parameters; give them as parameters=....") from error
        raise


def asks_for(function: Callable | None, name: str) -> bool:
    """Whether a function has an argument of this name."""
    if function is None:
        return False
    try:
        return name in inspect.signature(function).parameters
    except (TypeError, ValueError):  # some C functions have no signature
        return False


#: Positional arguments of each function, and optional arguments by name.
_ARGUMENTS = {
    "initial": (("key", "parameters"), ()),
    "transition": (("key", "x", "parameters"), ("previous", "time", "u")),
    "log_likelihood": (("y", "x", "parameters"), ("previous", "time", "u")),
    "observation": (("key", "x", "parameters"), ("previous", "time", "u")),
    "first_stage": (("y", "x", "parameters"), ("time", "u")),
    "transition_log_density": (("new", "x", "parameters"), ("previous", "time", "u")),
}


def check_arguments(name: str, function: object) -> None:
    """Refuse a value that is not a function, or a function with other arguments."""
    arguments, extras = _ARGUMENTS[name]
    if not callable(function):
        raise InputError(f"{name} is {function!r:.40}, which is not a function.")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        bound = signature.bind(*arguments, **{x: None for x in extras if x in signature.parameters})
        # argument -> its name in the function
        names = {place: name for name, place in bound.arguments.items() if place in arguments}
        is_right = not any(
            name != place and (name == "key" or names.get(name) == place)
            for place, name in names.items()
        )
    except TypeError:
        is_right = False
    if not is_right:
        optional = f"; it may also take {', '.join(extras)}" if extras else ""
        raise InputError(
            f"{name} takes {signature}, but must take ({', '.join(arguments)}){optional}."
        )


def layout_of(initial, transition, log_density, parameters, num_values=None) -> Layout:
    """Return the layout of a state; refuse other return values.  Only traces the functions."""
    key = jax.eval_shape(lambda: jax.random.key(0))

    def returned(name, function, *arguments):
        offered = {"previous": x, "time": jax.ShapeDtypeStruct((), jnp.int32)}
        extras = {name: value for name, value in offered.items() if asks_for(function, name)}

        def with_extras(arguments, extras):
            return call(name, function, *arguments, **extras)

        arguments = (*arguments, parameters), extras
        value = jax.eval_shape(with_extras, *arguments)
        _check_repeats(name, with_extras, arguments)
        return _state(name, value) if log_density is not function else number(name, value)

    x = None
    x = returned("initial", initial, key) if callable(initial) else _known(initial)
    x = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, _at_least_single(leaf)), x)
    # The kind of an input is not known yet; such functions are tried with the frames.
    while not asks_for(transition, "u"):
        new = returned("transition", transition, key, x)
        new = of_state(new, Layout.of(x, as_floats=True))
        # Whole numbers that move by floats are floats, as those of an initial 0.
        kept = jax.tree.map(
            lambda old, new: jax.ShapeDtypeStruct(
                old.shape,
                _at_least_single(new if jnp.issubdtype(new.dtype, jnp.floating) else old),
            ),
            x,
            new,
        )
        is_settled = Layout.of(kept) == Layout.of(x)
        x = x if is_settled else kept
        if is_settled:
            break
    if log_density is not None and not asks_for(log_density, "u"):
        returned("transition_log_density", log_density, x, x)
    return Layout.of(x, num_values)


def _known(initial: Any) -> Any:
    """Shapes and dtypes of a state given by its values; a list of numbers is one array."""
    if isinstance(initial, list) or type(initial) is tuple:
        return jax.eval_shape(jnp.asarray, checked_initial(initial))
    if not jax.tree.leaves(initial):
        raise InputError(
            f"initial is a {type(initial).__name__}; give the state as one array, or a pytree."
        )

    def of_leaf(leaf: Any) -> Any:
        shape = jax.eval_shape(jnp.asarray, checked_initial(leaf)).shape
        return jax.ShapeDtypeStruct(shape, jnp.result_type(leaf))

    return jax.tree.map(of_leaf, initial)


def _at_least_single(leaf: Any) -> Any:
    """The dtype of a leaf; half precision cannot separate particles."""
    is_float = jnp.issubdtype(leaf.dtype, jnp.floating)
    return jnp.promote_types(leaf.dtype, jnp.float32) if is_float else leaf.dtype


def _check_repeats(name: str, function: Callable, arguments: tuple) -> None:
    """Refuse a function that is another one at every trace, as with NumPy's random numbers."""

    def traced() -> tuple[str, list[np.ndarray]]:
        program = jax.make_jaxpr(lambda *x: function(*x))(*arguments)  # JAX caches by function
        return re.sub("0x[0-9a-f]+", "", str(program)), [
            np.asarray(x) for x in program.consts if is_concrete(x)
        ]

    (one, constants), (other, others) = traced(), traced()
    alike = len(constants) == len(others) and all(
        np.array_equal(a, b, equal_nan=a.dtype.kind in "fc")
        for a, b in zip(constants, others, strict=True)
    )
    if one != other or not alike:
        raise InputError(
            f"{name} gives another result at every call with the same key, such as by np.random; "
            "draw with jax.random from its key, as NumPy's numbers would be drawn only once."
        )


def of_state(new: Any, layout: Layout) -> Any:
    """Return what ``transition`` returns; refuse another structure than that of the state."""
    new = _state("transition", new)
    if (structure := jax.tree.structure(new)) != layout.structure:
        one, other = (str(each)[len("PyTreeDef(") : -1] for each in (structure, layout.structure))
        raise InputError(
            f"transition returns {one}, and initial {other}; both must return a state of one "
            "structure (* is an array)."
        )
    leaves = jax.tree_util.tree_leaves_with_path(new)
    for (path, x), leaf in zip(leaves, layout.leaves, strict=True):
        name = jax.tree_util.keystr(path)
        if x.shape != leaf.shape:
            raise InputError(
                f"transition returns shape {list(x.shape)}{name}, and initial {list(leaf.shape)}; "
                "both must return a state of one shape."
            )
        if leaf.dtype is not None and jnp.issubdtype(x.dtype, jnp.floating):
            raise InputError(
                f"transition returns floats{name}, and initial integers; write 0.0 for 0."
            )
    return new


def _state(name: str, state: Any) -> Any:
    def array(value: object) -> Any:
        if isinstance(value, int | float):
            value = np.asarray(value)
        return returned(value, None, name, "arrays")

    if not jax.tree.leaves(state):
        raise InputError(f"{name} returns {type(state).__name__}; return the state.")
    return jax.tree.map(array, state)


def number(name: str, value: object) -> jax.Array:
    """Return what a density returns; refuse what is not one real number."""
    wanted = "one number, for example the sum of independent terms"
    return returned(value, (), name, wanted)
