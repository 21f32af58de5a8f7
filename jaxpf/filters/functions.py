"""A particle filter from plain functions: a state-space model with a single state, no classes."""

import dataclasses
import inspect
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.filters.initial import as_floats, checked_initial
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.ordering import sir

#: Fields of ``Partitioned`` that do not apply to a model with a single state.
_NO_OPTIONS = {
    *("dynamics", "likelihood", "ordering", "initial", "initial_label", "parents", "num_particles"),
    *("look_ahead", "relocation", "refused"),
}


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
    """Build a particle filter for a state-space model from plain functions.

    The functions handle one particle.  A state x is an array of any shape, including ``[]``;
    summaries hold it flattened, such as ``summary.estimate`` ``[1, D]``::

        tracker = jaxpf.state_space(
            initial=lambda key, p: p["s"] * jax.random.normal(key),
            transition=lambda key, x, p: p["a"] * x + p["s"] * jax.random.normal(key),
            log_likelihood=lambda y, x, p: jax.scipy.stats.norm.logpdf(y, x, 0.5),
            parameters={"a": 0.9, "s": 0.3},
        )
        state, summaries = jaxpf.run(tracker, jax.random.key(0), y)

    The tracker is a ``Partitioned`` with one partition and works wherever those do.
    ``parameters`` are traced: ``vmap`` over calls of ``state_space`` to sweep them, use ``grad`` to
    differentiate; new values do not recompile.  ``jaxpf.tune`` names them ``parameters.a``.

    A new function object recompiles, and every evaluation of a lambda creates one.  Outside
    ``jit``, pass named functions, or call ``state_space`` once and change values with
    ``jaxpf.tuning.replace(tracker, {"parameters.a": 0.5})``.  Functions should read all varying
    values from ``parameters``.

    Args:
        initial: ``(key, parameters) -> x``, draws the state just before the first frame; or that
            state itself, an array.
        transition: ``(key, x, parameters) -> x``, draws the next state.  An argument named
            ``previous`` receives the state before x; one named ``time`` receives the number of the
            frame that the transition leads to, from 0.
        log_likelihood: ``(y, x, parameters) -> []``, log-density of a frame y, any pytree.  An
            argument named ``previous`` receives the state before x; summaries then hold ``[x,
            previous]``, 2 D numbers, and smoothing takes the whole clip, without a lag.
        parameters: pytree of numbers and arrays, the last positional argument of every function.
        transition_log_density: ``(new, x, parameters) -> []``, the log-density of ``transition``,
            for ``jaxpf.smooth`` and ``motion_gradient="score"``; may take ``previous`` and
            ``time``.
        num_particles: N.
        options: further fields of ``Partitioned``, such as ``resampling``, ``ess_threshold`` or
            ``gradient``.

    Raises:
        InputError: a function with other arguments or results, or an unknown option.
    """
    _check_arguments("transition", transition)
    _check_arguments("log_likelihood", log_likelihood)
    if callable(initial):
        _check_arguments("initial", initial)
    if transition_log_density is not None:
        _check_arguments("transition_log_density", transition_log_density)
    for path, leaf in jax.tree_util.tree_leaves_with_path(parameters):
        if not hasattr(leaf, "dtype") and not isinstance(leaf, int | float | complex):
            raise InputError(
                f"parameters{jax.tree_util.keystr(path)} is {leaf!r:.40}; give numbers and arrays."
            )
    options_of_filters = Partitioned.__dataclass_fields__.keys() - _NO_OPTIONS
    if unknown := sorted(options.keys() - options_of_filters):
        raise InputError(
            f"state_space has no option {unknown[0]!r}; besides its own arguments it takes "
            f"{', '.join(sorted(options_of_filters))}."
        )
    shape = _state_shape(initial, transition, transition_log_density, parameters)
    copies = 2 if _asks_for(log_likelihood, "previous") else 1
    if copies == 2 and options.get("proposal") is not None:
        options["proposal"] = FunctionProposal(options["proposal"])
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
    """Draws initial states ``[1, D]`` with a plain function."""

    parameters: Any
    function: Callable = static_field()
    copies: int = static_field()

    independent = True

    def __call__(self, key: jax.Array) -> jax.Array:
        """Draw an initial state."""
        x = as_floats(jnp.ravel(self.function(key, self.parameters)))
        return jnp.tile(x, self.copies)[None]


@pytree_dataclass
class FunctionDynamics(contract.Dynamics):
    """Dynamics from plain functions; a substate is the flattened state, or state and predecessor.

    The methods ``log_density`` and ``at_frame`` exist only if the functions need them.
    """

    parameters: Any
    transition: Callable = static_field()
    density: Callable | None = static_field()
    shape: tuple[int, ...] = static_field()
    copies: int = static_field()
    time: Any = None

    def propagate(self, key, partition, current, previous, parent):
        """Draw the new substate ``[D]``."""
        extras = self._extras(self.transition, previous)
        x = _state(current, self.shape)
        new = jnp.ravel(self.transition(key, x, self.parameters, **extras))
        return new if self.copies == 1 else jnp.concatenate([new, jnp.ravel(x)])

    @property
    def log_density(self):
        """Log of the density ``[]`` from which ``propagate`` draws."""
        density = self.density
        if density is None:
            raise AttributeError("log_density")

        def log_density(partition, new, current, previous, parent):
            states = (_state(x, self.shape) for x in (new, current))
            return density(*states, self.parameters, **self._extras(density, previous))

        return log_density

    @property
    def at_frame(self):
        """Return the dynamics that lead to a frame."""
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
class FunctionProposal(contract.Proposal):
    """A proposal of the state, for substates that hold the state and its predecessor."""

    proposal: Any

    def of_model(self, dynamics, likelihood):
        """See ``jaxpf.contract.Proposal``."""
        of_state = dataclasses.replace(dynamics, copies=1)
        return FunctionProposal(contract.proposal_of(self.proposal, of_state, likelihood))

    def propose_all(self, key, observation, partition, *past):
        """Draw substates ``[2 D, N]``."""
        states = [x[: len(x) // 2] for x in past]
        new = contract.propose_all(self.proposal, key, observation, partition, *states)
        return jnp.concatenate([new, states[0]])

    def log_density_all(self, observation, partition, *move):
        """Log-densities ``[N]`` of the new states; the predecessors are given."""
        states = [x[: len(x) // 2] for x in move]
        return contract.proposal_log_density_all(self.proposal, observation, partition, *states)


@pytree_dataclass
class FunctionLikelihood(contract.Likelihood):
    """A likelihood from a plain function."""

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
    except (TypeError, ValueError):  # some C functions have no signature
        return False


#: Positional arguments of each function, and optional arguments by name.
_ARGUMENTS = {
    "initial": (("key", "parameters"), ()),
    "transition": (("key", "x", "parameters"), ("previous", "time")),
    "log_likelihood": (("y", "x", "parameters"), ("previous",)),
    "transition_log_density": (("new", "x", "parameters"), ("previous", "time")),
}


def _check_arguments(name: str, function: Any) -> None:
    """Refuse a value that is not a function, or a function with other arguments."""
    arguments, extras = _ARGUMENTS[name]
    if not callable(function):
        raise InputError(f"{name} is {function!r:.40}, which is no function.")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(*arguments, **{x: None for x in extras if x in signature.parameters})
    except TypeError:
        optional = f"; it may also take {' and '.join(extras)}" if extras else ""
        raise InputError(
            f"{name} takes {signature}, but must take ({', '.join(arguments)}){optional}."
        ) from None


def _state_shape(initial, transition, log_density, parameters) -> tuple[int, ...]:
    """Return the shape of a state; refuse other return values.  Only traces the functions."""
    key = jax.eval_shape(lambda: jax.random.key(0))

    def returned(name, function, *arguments):
        offered = {"previous": x, "time": jax.ShapeDtypeStruct((), jnp.int32)}
        extras = {name: value for name, value in offered.items() if _asks_for(function, name)}
        value = jax.eval_shape(
            lambda arguments, extras: function(*arguments, **extras),
            (*arguments, parameters),
            extras,
        )
        return _array(name, value) if log_density is not function else _number(name, value)

    x = None
    if callable(initial):
        x = returned("initial", initial, key)
    elif jax.tree_util.all_leaves([initial]) or isinstance(initial, list | tuple):
        x = jax.eval_shape(jnp.asarray, checked_initial(initial))
    else:
        raise InputError(f"initial is a {type(initial).__name__}; give the state as one array.")
    x = jax.ShapeDtypeStruct(x.shape, jnp.promote_types(x.dtype, jnp.float32))
    new = returned("transition", transition, key, x)
    if new.shape != x.shape:
        raise InputError(
            f"transition returns shape {list(new.shape)}, and initial {list(x.shape)}; both must "
            "return a state of one shape."
        )
    if log_density is not None:
        returned("transition_log_density", log_density, x, x)
    return x.shape


def _array(name: str, value: Any) -> Any:
    if not hasattr(value, "shape"):
        raise InputError(f"{name} returns {type(value).__name__}; return the state as one array.")
    if jnp.issubdtype(value.dtype, jnp.complexfloating):
        raise InputError(f"{name} returns complex numbers; return real ones.")
    return value


def _number(name: str, value: Any) -> Any:
    if value is None:
        raise InputError(f"{name} returns nothing; return one number.")
    if jnp.iscomplexobj(value):
        raise InputError(f"{name} returns complex numbers; return real ones.")
    if jnp.shape(value) != ():
        raise InputError(
            f"{name} returns shape {list(jnp.shape(value))}; return one number, for example the "
            "sum of independent terms."
        )
    return value
