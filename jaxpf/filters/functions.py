"""A particle filter from plain functions: a state-space model with a single state, no classes."""

import inspect
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.ordering import sir


def state_space(
    *,
    initial: Any,
    transition: Callable,
    log_likelihood: Callable,
    parameters: Any = None,
    transition_log_density: Callable | None = None,
    num_particles: int = 1000,
    **options: Any,
) -> Partitioned:
    """A particle filter for a state-space model that is given by plain functions.

    The functions speak of one particle.  A state x is an array of any shape, ``[]`` included;
    reports hold it flattened, such as ``summary.estimate`` ``[1, D]``::

        tracker = jaxpf.state_space(
            initial=lambda key, p: p["s"] * jax.random.normal(key),
            transition=lambda key, x, p: p["a"] * x + p["s"] * jax.random.normal(key),
            log_likelihood=lambda y, x, p: jax.scipy.stats.norm.logpdf(y, x, 0.5),
            parameters={"a": 0.9, "s": 0.3},
        )
        state, summaries = jaxpf.run(tracker, jax.random.key(0), y)

    The tracker is a ``Partitioned`` with one partition, so whatever takes one of those takes it.
    ``parameters`` are traced: a sweep is a ``vmap`` over calls of ``state_space``, a gradient a
    ``grad``, and new values compile nothing; ``jaxpf.tune`` calls them ``parameters.a``.  What
    does compile anew is a new function: pass named functions, or make lambdas once, and let them
    read what varies from ``parameters`` rather than from outside.

    Args:
        initial: ``(key, parameters) -> x``, a draw of the state just before the first frame; or
            that state itself, an array.
        transition: ``(key, x, parameters) -> x``, a draw of the next state.  With an argument
            ``previous`` it also gets the state before x, with ``time`` the number of the frame
            that it leads to, from 0.
        log_likelihood: ``(y, x, parameters) -> []``, log-density of a frame y, any pytree.  With an
            argument ``previous`` it also gets the state before x; reports then hold ``[x,
            previous]``, 2 D numbers, and smoothing is not available.
        parameters: pytree of numbers and arrays, the last positional argument of every function.
        transition_log_density: ``(new, x, parameters) -> []``, the log-density of ``transition``,
            for ``jaxpf.smooth`` and ``motion_gradient="score"``; may ask for ``previous`` and
            ``time``.
        num_particles: N.
        options: of ``Partitioned``, such as ``resampling``, ``ess_threshold`` or ``gradient``.

    Raises:
        InputError: a function that takes or returns something else, or an unknown option.
    """
    _check_functions(initial, transition, log_likelihood, transition_log_density)
    fields = Partitioned.__dataclass_fields__
    fixed = {"dynamics", "likelihood", "ordering", "initial", "parents", "num_particles"}
    if unknown := sorted(options.keys() - (fields.keys() - fixed)):
        raise InputError(
            f"state_space has no option {unknown[0]!r}; besides its own arguments it takes "
            f"{', '.join(sorted(fields.keys() - fixed))}."
        )
    keeps_previous = _asks_for(log_likelihood, "previous")
    if keeps_previous and transition_log_density is not None:
        raise InputError(
            "transition_log_density serves smoothing, which does not go with a log_likelihood that "
            "asks for the previous state; leave one of them out."
        )
    shape = _state_shape(initial, transition, parameters, transition_log_density)
    copies = 2 if keeps_previous else 1
    return Partitioned(
        dynamics=FunctionDynamics(parameters, transition, transition_log_density, shape, copies),
        likelihood=FunctionLikelihood(parameters, log_likelihood, shape),
        ordering=sir(1),
        initial=FunctionSampler(parameters, initial, copies)
        if callable(initial)
        else jnp.tile(jnp.ravel(jnp.asarray(initial)), copies)[None],
        num_particles=num_particles,
        **options,
    )


@pytree_dataclass
class FunctionSampler:
    """Initial states ``[1, D]``, drawn by a plain function."""

    parameters: Any
    function: Callable = static_field()
    copies: int = static_field()

    independent = True

    def __call__(self, key: jax.Array) -> jax.Array:
        """A draw."""
        return jnp.tile(jnp.ravel(self.function(key, self.parameters)), self.copies)[None]


@pytree_dataclass
class FunctionDynamics(contract.Dynamics):
    """Dynamics by plain functions; a substate is the state, flattened, or two copies of it.

    The methods ``log_density`` and ``at_frame`` exist only if the functions call for them.
    """

    parameters: Any
    transition: Callable = static_field()
    density: Callable | None = static_field()
    shape: tuple[int, ...] = static_field()
    copies: int = static_field()
    time: Any = None

    def propagate(self, key, partition, current, previous, parent):
        """The new substate ``[D]``."""
        extras = self._extras(self.transition, previous)
        x = _state(current, self.shape)
        new = jnp.ravel(self.transition(key, x, self.parameters, **extras))
        return new if self.copies == 1 else jnp.concatenate([new, jnp.ravel(x)])

    @property
    def log_density(self):
        """Log of the density ``[]`` from which ``propagate`` draws."""
        if self.density is None:
            raise AttributeError("log_density")

        def log_density(partition, new, current, previous, parent):
            states = (_state(x, self.shape) for x in (new, current))
            extras = self._extras(self.density, previous)
            return self.density(*states, self.parameters, **extras)

        return log_density

    @property
    def at_frame(self):
        """The dynamics that lead to a frame."""
        if not any(f and _asks_for(f, "time") for f in (self.transition, self.density)):
            raise AttributeError("at_frame")
        fixed = self.transition, self.density, self.shape, self.copies
        return lambda time: FunctionDynamics(self.parameters, *fixed, time=time)

    def _extras(self, function, previous):
        extras = {}
        if _asks_for(function, "previous"):
            extras["previous"] = _state(previous, self.shape)
        if _asks_for(function, "time"):
            if self.time is None:
                raise InputError(
                    "the model asks for the time of a frame, which step does not know; use "
                    "jaxpf.run, or step jaxpf.contract.at_frame(tracker, time)."
                )
            extras["time"] = self.time
        return extras


@pytree_dataclass
class FunctionLikelihood(contract.Likelihood):
    """A likelihood by a plain function."""

    parameters: Any
    function: Callable = static_field()
    shape: tuple[int, ...] = static_field()

    def log_prob(self, observation, partition, substate):
        """Log-likelihood ``[]`` of a substate ``[D]``."""
        extras = {}
        if _asks_for(self.function, "previous"):
            extras["previous"] = _state(substate[math.prod(self.shape) :], self.shape)
        x = _state(substate, self.shape)
        return _number("log_likelihood", self.function(observation, x, self.parameters, **extras))


def _state(substate: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    return substate[: math.prod(shape)].reshape(shape)


def _asks_for(function: Callable, name: str) -> bool:
    try:
        return name in inspect.signature(function).parameters
    except (TypeError, ValueError):  # a function of C, which says nothing
        return False


def _check_functions(initial, transition, log_likelihood, transition_log_density) -> None:
    functions = (
        ("initial", initial, ("key", "parameters"), ()),
        ("transition", transition, ("key", "x", "parameters"), ("previous", "time")),
        ("log_likelihood", log_likelihood, ("y", "x", "parameters"), ("previous",)),
        (
            "transition_log_density",
            transition_log_density,
            ("new", "x", "parameters"),
            ("previous", "time"),
        ),
    )
    for name, function, arguments, extras in functions:
        if not callable(function):
            if name in ("transition", "log_likelihood") or (
                name == "transition_log_density" and function is not None
            ):
                raise InputError(f"{name} is {function!r:.40}, which is no function.")
            continue
        try:
            signature = inspect.signature(function)
        except (TypeError, ValueError):
            continue
        asked = {extra: None for extra in extras if extra in signature.parameters}
        try:
            signature.bind(*arguments, **asked)
        except TypeError:
            optional = f", and if it likes {' or '.join(extras)}" if extras else ""
            raise InputError(
                f"{name} takes {signature}; it must take ({', '.join(arguments)}){optional}."
            ) from None


def _state_shape(initial, transition, parameters, transition_log_density) -> tuple[int, ...]:
    """The shape of a state; the functions are traced, not run."""
    key = jax.eval_shape(lambda: jax.random.key(0))
    if callable(initial):
        x = _array("initial", jax.eval_shape(initial, key, parameters))
    else:
        x = jax.eval_shape(jnp.asarray, initial)
    x = jax.ShapeDtypeStruct(x.shape, jnp.promote_types(x.dtype, jnp.float32))

    def extras(function):
        time = jax.ShapeDtypeStruct((), jnp.int32)
        known = {"previous": x, "time": time}
        return {name: value for name, value in known.items() if _asks_for(function, name)}

    new = jax.eval_shape(
        lambda *arguments: transition(*arguments[:-1], **arguments[-1]),
        *(key, x, parameters, extras(transition)),
    )
    new = _array("transition", new)
    if new.shape != x.shape:
        raise InputError(
            f"transition returns shape {list(new.shape)}, and initial {list(x.shape)}; both must "
            "return a state of one shape."
        )
    if transition_log_density is not None:
        _number(
            "transition_log_density",
            jax.eval_shape(
                lambda *arguments: transition_log_density(*arguments[:-1], **arguments[-1]),
                *(x, x, parameters, extras(transition_log_density)),
            ),
        )
    return x.shape


def _array(name: str, value: Any) -> Any:
    if not hasattr(value, "shape"):
        raise InputError(f"{name} returns {type(value).__name__}; return the state as one array.")
    if jnp.issubdtype(value.dtype, jnp.complexfloating):
        raise InputError(f"{name} returns complex numbers; return real ones.")
    return value


def _number(name: str, value: Any) -> Any:
    if jnp.shape(value) != ():
        raise InputError(
            f"{name} returns shape {list(jnp.shape(value))}; return one number, for example the "
            "sum of independent terms."
        )
    return value
