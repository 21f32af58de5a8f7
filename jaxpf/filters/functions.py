"""A particle filter from plain functions: a state-space model with a single state, no classes."""

import dataclasses
import inspect
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import (
    is_concrete,
    pytree_dataclass,
    static_field,
    with_static_functions,
)
from jaxpf.contract.recognised import recognised
from jaxpf.contract.types import ProposalLike
from jaxpf.filters.initial import checked_initial
from jaxpf.filters.layout import Layout, at_least_single
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.gradients import Gradient, NoGradient
from jaxpf.ordering import sir
from jaxpf.proposals import WrappedProposal


def state_space(
    *,
    initial: Any,
    transition: Callable,
    log_likelihood: Callable,
    parameters: Any = None,
    transition_log_density: Callable | None = None,
    observation: Callable | None = None,
    first_stage: Callable | None = None,
    num_values: int | Mapping[str, int] | None = None,
    num_particles: int = 1000,
    resampling: Any = "systematic",
    ess_threshold: Any = None,
    proposal: ProposalLike | None = None,
    gradient: Gradient = NoGradient(),  # noqa: B008
    motion_gradient: str = "pathwise",
    keep_ancestors: bool = False,
) -> Partitioned:
    """Build a particle filter for a state-space model from plain functions.

    The functions handle one particle.  A state x is an array of any shape, including ``[]``, or a
    pytree of arrays, such as ``{"position": ..., "regime": ...}``.  Integers stay integers, and
    exact; their means are floats.
    Summaries hold an array flattened, such as ``summary.estimate`` ``[1, D]``, and a pytree as
    that pytree, such as ``summary.estimate["position"]``::

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

    A function recompiles if its code, or a value that it closes over, has changed
    (``jaxpf.contract.recognised``).  Functions should read all varying values from ``parameters``;
    ``jaxpf.tuning.replace(tracker, {"parameters.a": 0.5})`` changes them.

    Args:
        initial: ``(key, parameters) -> x``, draws the state just before the first frame; or that
            state itself, an array or a pytree.  Derivatives in its parameters go through the drawn
            values alone, so that those of the probabilities of integers are 0.
        transition: ``(key, x, parameters) -> x``, draws the next state.  An argument named
            ``previous`` receives the state before x; one named ``time`` the number of the frame
            that the transition leads to, from 0; one named ``u`` that frame's known input, a row of
            ``inputs`` of ``jaxpf.run``.
        log_likelihood: ``(y, x, parameters) -> []``, log-density of a frame y, any pytree.  It may
            take ``time`` and ``u``, too.  An argument named ``previous`` receives the state before
            x; summaries then hold ``[x, previous]``, 2 D numbers, and smoothing takes the whole
            clip, without a lag.  Frames with some NaN are refused unless the function's attribute
            ``handles_nan`` is true; the function must then replace NaN before it computes anything
            (``jnp.where(jnp.isnan(y), 0.0, y)``): after ``jnp.nansum`` the gradient is NaN.
        parameters: pytree of numbers, arrays and functions, such as an Equinox network; the last
            positional argument of every function.
        transition_log_density: ``(new, x, parameters) -> []``, the log-density of ``transition``,
            for ``jaxpf.smooth``, a ``proposal`` and ``motion_gradient="score"``; the last, and
            linearised proposals, need noise in every number that moves, and no ``u``.  It may
            take ``previous``, ``time`` and ``u``.
        observation: ``(key, x, parameters) -> y``, draws a frame, for ``jaxpf.simulate`` and the
            predictive draws of ``jaxpf.pmmh``; may take ``previous``, ``time`` and ``u``.
        first_stage: ``(y, x, parameters) -> []``, log of the first-stage weight of an
            auxiliary particle filter, of the state before it moves to frame y, such as a rough
            log-density of y given it.  Any such weight leaves the evidence unbiased.  It may take
            ``time`` and ``u``.
        num_values: K, if integers in the state take the values 0 to K - 1; or K by name of a leaf,
            such as ``{"regime": 3}``.  The estimate of an integer is then the probability of each
            value, ``[..., K]``, instead of the mean.
        num_particles: N.
        resampling, ess_threshold, proposal, gradient, motion_gradient, keep_ancestors: as for
            ``Partitioned``.

    Returns:
        The tracker, a ``Partitioned`` with one partition.
    """
    parameters = with_static_functions(parameters)
    functions = Functions(
        *map(
            recognised,
            (
                initial if callable(initial) else None,
                transition,
                log_likelihood,
                transition_log_density,
                observation,
                first_stage,
            ),
        )
    )
    if isinstance(initial, list) or type(initial) is tuple:  # one array
        initial = (np if is_concrete(initial) else jnp).asarray(initial, float)
    layout = _layout_of(functions, initial, parameters, num_values)
    if functions.ask("previous", "log_likelihood", "observation"):
        layout = layout._replace(copies=2)
    if layout.copies == 2 and proposal is not None:
        proposal = FunctionProposal(proposal)
    has_integers = any(leaf.dtype is not None for leaf in layout.leaves)
    if has_integers and gradient.blends:
        raise InputError(
            "gradient Transport blends particles, and the state holds integers or bools, which "
            "have no values between; use jaxpf.gradients.StopGradient()."
        )
    if has_integers and gradient.keeps_scores and motion_gradient == "pathwise":
        warnings.warn(
            "no derivative passes through the integers or bools of the state, so those in the "
            "parameters that move them are 0; give transition_log_density and "
            "motion_gradient='score'.",
            stacklevel=2,
        )
    state = None
    if not callable(initial):
        state = layout.arrays(initial)
        if is_concrete(state) and layout.is_outside(jax.tree.map(np.asarray, state)):
            raise InputError(
                f"initial={initial!r:.60} holds an integer that is not from 0 to num_values - 1; "
                "count the values from 0."
            )
    model = parameters, functions, layout
    return StateSpace(
        dynamics=FunctionDynamics(*model),
        likelihood=FunctionLikelihood(*model),
        ordering=_ORDERING,
        initial=FunctionSampler(*model, state=state),
        num_particles=num_particles,
        resampling=resampling,
        ess_threshold=ess_threshold,
        proposal=proposal,
        gradient=gradient,
        motion_gradient=motion_gradient,
        keep_ancestors=keep_ancestors,
    )


class Functions(NamedTuple):
    """The user's functions; hashable.  None for what was not given."""

    initial: Callable | None
    transition: Callable
    log_likelihood: Callable
    transition_log_density: Callable | None
    observation: Callable | None
    first_stage: Callable | None

    def ask(self, argument: str, *names: str) -> bool:
        """Whether one of the functions ``names`` has an argument of this name."""
        return any(argument in _arguments_of(getattr(self, name)) for name in names)

    def call(self, name: str, *arguments: Any, **extras: Any) -> Any:
        """Call a function, its parameters last; a note on its exception says which it is."""
        function: Any = getattr(self, name)
        try:
            return function(*arguments, **extras)
        except Exception as error:
            error.add_note(
                f"In {name} ({getattr(function, '__name__', function)}) of jaxpf.state_space, "
                f"which is given {_GIVEN[name]}.  Only jaxpf.run and its like know the time, and u "
                "if they are given inputs=."
            )
            raise


#: Arguments of each function; an exception of a function says what it is given.
_GIVEN = {
    "initial": "(key, parameters)",
    "transition": "(key, x, parameters), and may take previous, time or u",
    "log_likelihood": "(y, x, parameters), and may take previous, time or u",
    "observation": "(key, x, parameters), and may take previous, time or u",
    "first_stage": "(y, x, parameters), and may take time or u",
    "transition_log_density": "(new, x, parameters), and may take previous, time or u",
}


def _arguments_of(function: Callable | None) -> Iterable[str]:
    try:
        return inspect.signature(function).parameters if function is not None else ()
    except (TypeError, ValueError):  # some C functions have no signature
        return ()


def _layout_of(functions: Functions, initial: Any, parameters: Any, num_values: Any) -> Layout:
    """Return the layout of a state.  Only traces the functions."""
    key = jax.eval_shape(lambda: jax.random.key(0))

    def traced(name: str, *arguments: Any, **extras: Any) -> Any:
        def call(*arguments, **extras):
            return jax.tree.map(jnp.asarray, functions.call(name, *arguments, **extras))

        return jax.eval_shape(call, *arguments, parameters, **extras)

    def shaped(leaf: Any) -> jax.ShapeDtypeStruct:
        shape = jnp.shape(checked_initial(leaf))
        return jax.ShapeDtypeStruct(shape, at_least_single(jnp.result_type(leaf)))

    if callable(initial):
        x = jax.tree.map(
            lambda leaf: leaf.update(dtype=at_least_single(leaf.dtype)), traced("initial", key)
        )
    else:
        x = jax.tree.map(shaped, initial)

    def moved(old: Any, new: Any) -> Any:
        """Whole numbers that move by floats are floats, as those of an initial 0."""
        is_float = jnp.issubdtype(new.dtype, jnp.floating)
        return old.update(dtype=at_least_single(new.dtype)) if is_float else old

    # The kind of an input is not known yet; such functions are tried with the frames.
    while not functions.ask("u", "transition"):
        offered = {"previous": x, "time": jax.ShapeDtypeStruct((), jnp.int32)}
        extras = {name: offered[name] for name in offered if functions.ask(name, "transition")}
        before, x = x, jax.tree.map(moved, x, traced("transition", key, x, **extras))
        if Layout.of(before) == Layout.of(x):
            break
    return Layout.of(x, num_values)


class StateSpace(Partitioned):
    """A particle filter of plain functions; summaries of states that are pytrees name their leaves.

    As a pytree it holds the parameters of its functions once, so that a derivative in them is
    whole, and no ordering, as a single partition has only one.
    """

    dynamics: Any  # ``FunctionDynamics``

    @property
    def sees_previous(self) -> bool:
        """See ``Partitioned``."""
        return self.dynamics.layout.copies == 2

    def step_observed(self, key, state, observation):
        """See ``Partitioned``."""
        state, summary = super().step_observed(key, state, observation)
        estimate, spread = map(self.moments, (summary.estimate, summary.spread))
        return state, dataclasses.replace(summary, estimate=estimate, spread=spread)

    def moments(self, values: jax.Array) -> Any:
        """Means or standard deviations of substates, ``[..., 1, D]``; a pytree's by its leaves."""
        layout = self.dynamics.layout
        if not layout.is_array:
            return layout.split(values[..., 0, :])
        if layout.size == layout.num_values:
            return values
        values = values.reshape(*values.shape[:-1], layout.copies, -1)[..., : layout.num_values]
        return values.reshape(*values.shape[:-2], -1)

    @property
    def states(self) -> Callable:
        """States of particles, from their substates ``[..., 1, D]``, if those are not the same."""
        layout = self.dynamics.layout
        if layout.is_array and layout.size == layout.num_values:
            raise AttributeError("states")

        def states(substates: jax.Array) -> Any:
            found = layout.unpack(substates[..., 0, :])
            return found.reshape(*substates.shape[:-1], -1) if layout.is_array else found

        return states


#: Fields of a tracker that hold arrays, and settings.
_DATA, _SETTINGS = (
    [f.name for f in dataclasses.fields(StateSpace) if f.metadata.get("static", False) is static]
    for static in (False, True)
)
_ORDERING = sir(1)


def _flatten(tracker: StateSpace) -> tuple[list, tuple]:
    parts = {name: getattr(tracker, name) for name in _DATA}
    parameters = getattr(tracker.dynamics, "parameters", None)
    shared = [name for name in parts if getattr(parts[name], "parameters", ...) is parameters]
    parts |= {name: _with_parameters(parts[name], None) for name in shared}
    if tracker.ordering is _ORDERING:
        parts["ordering"] = None
    named = {"parameters": parameters} | parts
    children = [(jax.tree_util.GetAttrKey(name), value) for name, value in named.items()]
    return children, (tuple(shared), *(getattr(tracker, name) for name in _SETTINGS))


def _unflatten(static: tuple, children: Iterable) -> StateSpace:
    (shared, *settings), (parameters, *values) = static, children
    tracker = object.__new__(StateSpace)
    for name, value in zip(_DATA + _SETTINGS, values + settings, strict=True):
        if name in shared and hasattr(value, "parameters"):
            value = _with_parameters(value, parameters)
        value = _ORDERING if name == "ordering" and value is None else value
        object.__setattr__(tracker, name, value)
    return tracker


def _with_parameters(part: Any, parameters: Any) -> Any:
    return calls.changed_inside(part, "parameters", lambda _: parameters)


jax.tree_util.register_pytree_with_keys(StateSpace, _flatten, _unflatten)


@pytree_dataclass
class _OfFunctions:
    """A part of the model that calls some of the user's functions, ``_calls``.

    Attributes:
        parameters: of the functions.
        functions: static, all of them.
        layout: static, of the state in a substate.
        inputs: of known frames, and the number of the first; or None.
        frame: ``time`` and ``u`` of one frame, as far as known.
    """

    parameters: Any
    functions: Functions = static_field()
    layout: Layout = static_field()
    inputs: Any = None
    frame: Any = None

    _calls: ClassVar[tuple[str, ...]] = ()

    def _called(self, name: str, *arguments: Any, previous: Any = None) -> Any:
        """Call a function with what it asks for; ``previous`` is the substate before the last.

        It is not touched unless the function asks for it: smoothing must not see it in use.
        """
        known = (self.frame or {}).items()
        extras = {
            argument: value for argument, value in known if self.functions.ask(argument, name)
        }
        if self.functions.ask("previous", name):
            extras["previous"] = self.layout.unpack(previous)
        return self.functions.call(name, *arguments, self.parameters, **extras)

    @property
    def at_frame(self) -> Callable:
        """Return this part for a frame; exists only if a function asks for time or input."""
        if not any(self.functions.ask(argument, *self._calls) for argument in ("time", "u")):
            raise AttributeError("at_frame")
        return self._at_frame

    def _at_frame(self, time: ArrayLike) -> Any:
        frame = {"time": time}
        if self.inputs is not None:
            values, first = self.inputs
            frame["u"] = jax.tree.map(
                lambda x: lax.dynamic_index_in_dim(jnp.asarray(x), time - first, keepdims=False),
                values,
            )
        return dataclasses.replace(self, frame=frame)

    @property
    def with_inputs(self) -> Callable:
        """Return this part with known inputs; exists only if a function asks for an input."""
        if not self.functions.ask("u", *self._calls):
            raise AttributeError("with_inputs")
        return lambda inputs, first: dataclasses.replace(self, inputs=(inputs, first))


@pytree_dataclass
class FunctionSampler(_OfFunctions):
    """Draws initial states ``[1, D]`` with a plain function, or returns the known ``state``.

    The numbers of a known state are as precise as those of the run.
    """

    state: Any = None

    independent = True

    def __call__(self, key: jax.Array) -> jax.Array:
        """Draw an initial state."""
        x = self._called("initial", key) if self.state is None else self.state
        return jnp.tile(self.layout.pack(x), self.layout.copies)[None]


@pytree_dataclass
class FunctionDynamics(_OfFunctions, contract.Dynamics):
    """Dynamics from plain functions; a substate is the flattened state, or state and predecessor.

    The method ``log_density`` exists only if its function was given.
    """

    _calls = ("transition", "transition_log_density")

    def propagate(self, key, partition, current, previous, parent):
        """Draw the new substate ``[D]``."""
        x = self.layout.unpack(current)
        new = self.layout.pack(self._called("transition", key, x, previous=previous))
        if self.layout.copies == 1:
            return new
        return jnp.concatenate([new, current[: self.layout.size]])

    @property
    def log_density(self):
        """Log of the density ``[]`` from which ``propagate`` draws."""
        if self.functions.transition_log_density is None:
            raise AttributeError("log_density")

        def log_density(partition, new, current, previous, parent):
            states = (self.layout.unpack(x) for x in (new, current))
            value = self._called("transition_log_density", *states, previous=previous)
            return jnp.reshape(value, ())

        return log_density


@pytree_dataclass
class FunctionProposal(WrappedProposal):
    """A proposal of the state, for substates that hold the state and its predecessor."""

    proposal: Any

    def of_model(self, dynamics, likelihood):
        """See ``jaxpf.contract.Proposal``."""
        of_state = dataclasses.replace(dynamics, layout=dynamics.layout._replace(copies=1))
        return FunctionProposal(calls.proposal_of(self.proposal, of_state, likelihood))

    def propose_all(self, key, observation, partition, *past):
        """Draw substates ``[2 D, N]``."""
        states = [x[: len(x) // 2] for x in past]
        new = calls.propose_all(self.proposal, key, observation, partition, *states)
        return jnp.concatenate([new, states[0]])

    def log_density_all(self, observation, partition, *move):
        """Log-densities ``[N]`` of the new states; the predecessors are given."""
        states = [x[: len(x) // 2] for x in move]
        return calls.proposal_log_density_all(self.proposal, observation, partition, *states)


@pytree_dataclass
class FunctionLikelihood(_OfFunctions, contract.Likelihood):
    """A likelihood from a plain function."""

    _calls = ("log_likelihood", "observation", "first_stage")

    @property
    def handles_nan(self):
        """Whether the function declares that it understands NaN."""
        return optional(self.functions.log_likelihood, "handles_nan")

    def log_prob(self, observation, partition, substate):
        """Log-likelihood ``[]`` of a substate ``[D]``."""
        value = jnp.reshape(self._of_substate("log_likelihood", observation, substate), ())
        outside = self.layout.is_outside(self.layout.unpack(substate))
        return value if outside is False else jnp.where(outside, jnp.nan, value)

    @property
    def log_first_stage(self):
        """Log of a first-stage weight; exists only with ``first_stage``."""
        if self.functions.first_stage is None:
            raise AttributeError("log_first_stage")
        return lambda observation, substates: jnp.reshape(
            self._of_substate("first_stage", observation, substates[0]), ()
        )

    @property
    def sample(self):
        """Draw a frame, given substates ``[1, D]``; exists only with an ``observation``."""
        if self.functions.observation is None:
            raise AttributeError("sample")
        return lambda key, substates: jax.tree.map(
            jnp.asarray, self._of_substate("observation", key, substates[0])
        )

    def _of_substate(self, name: str, first: Any, substate: jax.Array) -> Any:
        x, previous = self.layout.unpack(substate), substate[self.layout.size :]
        return self._called(name, first, x, previous=previous)
