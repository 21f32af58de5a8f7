"""The plain functions of a state-space model: their calls, and the layout of their state."""

import inspect
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.filters.initial import checked_initial
from jaxpf.filters.layout import Layout

#: Arguments of each function; an exception of a function says what it is given.
_ARGUMENTS = {
    "initial": "(key, parameters)",
    "transition": "(key, x, parameters), and may take previous, time or u",
    "log_likelihood": "(y, x, parameters), and may take previous, time or u",
    "observation": "(key, x, parameters), and may take previous, time or u",
    "first_stage": "(y, x, parameters), and may take time or u",
    "transition_log_density": "(new, x, parameters), and may take previous, time or u",
}


def call(name: str, function: Callable, *arguments: Any, **extras: Any) -> Any:
    """Call a user's function, its parameters last; a note on its exception says which it is."""
    try:
        return function(*arguments, **extras)
    except Exception as error:
        error.add_note(
            f"In {name} ({getattr(function, '__name__', function)}) of jaxpf.state_space, which is "
            f"given {_ARGUMENTS[name]}.  Only jaxpf.run and its like know the time, and u if they "
            "are given inputs=."
        )
        raise


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
    return extras


def asks_for(function: Callable | None, name: str) -> bool:
    """Whether a function has an argument of this name."""
    if function is None:
        return False
    try:
        return name in inspect.signature(function).parameters
    except (TypeError, ValueError):  # some C functions have no signature
        return False


def layout_of(initial, transition, parameters, num_values=None) -> Layout:
    """Return the layout of a state.  Only traces the functions."""
    key = jax.eval_shape(lambda: jax.random.key(0))

    def traced(name: str, function: Callable, *arguments: Any, **extras: Any) -> Any:
        def with_extras(arguments, extras):
            return jax.tree.map(jnp.asarray, call(name, function, *arguments, **extras))

        return jax.eval_shape(with_extras, (*arguments, parameters), extras)

    if callable(initial):
        x = traced("initial", initial, key)
    elif isinstance(initial, list) or type(initial) is tuple:  # one array
        x = jax.eval_shape(jnp.asarray, checked_initial(initial))
    else:
        x = jax.tree.map(
            lambda leaf: jax.ShapeDtypeStruct(
                jnp.shape(checked_initial(leaf)), jnp.result_type(leaf)
            ),
            initial,
        )
    x = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, _at_least_single(leaf)), x)
    # The kind of an input is not known yet; such functions are tried with the frames.
    while not asks_for(transition, "u"):
        offered = {"previous": x, "time": jax.ShapeDtypeStruct((), jnp.int32)}
        extras = {name: value for name, value in offered.items() if asks_for(transition, name)}
        new = traced("transition", transition, key, x, **extras)
        # Whole numbers that move by floats are floats, as those of an initial 0.
        kept = jax.tree.map(
            lambda old, new: jax.ShapeDtypeStruct(
                old.shape,
                _at_least_single(new if jnp.issubdtype(new.dtype, jnp.floating) else old),
            ),
            x,
            new,
        )
        if Layout.of(kept) == Layout.of(x):
            break
        x = kept
    return Layout.of(x, num_values)


def _at_least_single(leaf: Any) -> Any:
    """The dtype of a leaf; half precision cannot separate particles."""
    is_float = jnp.issubdtype(leaf.dtype, jnp.floating)
    return jnp.promote_types(leaf.dtype, jnp.float32) if is_float else leaf.dtype
