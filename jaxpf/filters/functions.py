"""A particle filter from plain functions: a state-space model with a single state, no classes."""

import dataclasses
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.optional import optional
from jaxpf.contract.pytree import (
    is_concrete,
    pytree_dataclass,
    static_field,
    with_static_functions,
)
from jaxpf.contract.recognised import recognised
from jaxpf.contract.types import ProposalLike
from jaxpf.filters.layout import Layout
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.filters.user_functions import asks_for, call, extras_of, layout_of
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
    initial, transition, log_likelihood, transition_log_density, observation, first_stage = map(
        recognised,
        (initial, transition, log_likelihood, transition_log_density, observation, first_stage),
    )
    layout = layout_of(initial, transition, parameters, num_values)
    copies = 2 if any(asks_for(f, "previous") for f in (log_likelihood, observation)) else 1
    if copies == 2 and proposal is not None:
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
    if callable(initial):
        start: Any = FunctionSampler(parameters, initial, layout, copies)
    else:
        start = Given(layout.arrays(initial), layout, copies)
        if is_concrete(initial) and layout.is_outside(jax.tree.map(np.asarray, start.state)):
            raise InputError(
                f"initial={initial!r:.60} holds an integer that is not from 0 to num_values - 1; "
                "count the values from 0."
            )
    return StateSpace(
        dynamics=FunctionDynamics(parameters, transition, transition_log_density, layout, copies),
        likelihood=FunctionLikelihood(parameters, log_likelihood, layout, observation, first_stage),
        ordering=_ORDERING,
        initial=start,
        num_particles=num_particles,
        resampling=resampling,
        ess_threshold=ess_threshold,
        proposal=proposal,
        gradient=gradient,
        motion_gradient=motion_gradient,
        keep_ancestors=keep_ancestors,
    )


class StateSpace(Partitioned):
    """A particle filter of plain functions; summaries of states that are pytrees name their leaves.

    As a pytree it holds the parameters of its functions once, so that a derivative in them is
    whole, and no ordering, as a single partition has only one.
    """

    dynamics: Any  # ``FunctionDynamics``

    def step_observed(self, key, state, observation):
        """See ``Partitioned``."""
        state, summary = super().step_observed(key, state, observation)
        estimate, spread = map(self.moments, (summary.estimate, summary.spread))
        return state, dataclasses.replace(summary, estimate=estimate, spread=spread)

    def moments(self, values: jax.Array) -> Any:
        """Means or standard deviations of substates, ``[..., 1, D]``; a pytree's by its leaves."""
        layout, copies = self.dynamics.layout, self.dynamics.copies
        if not layout.is_array:
            return layout.split(values[..., 0, :])
        if layout.size == layout.num_values:
            return values
        values = values.reshape(*values.shape[:-1], copies, -1)[..., : layout.num_values]
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
class FunctionSampler:
    """Draws initial states ``[1, D]`` with a plain function."""

    parameters: Any
    function: Callable = static_field()
    layout: Layout = static_field()
    copies: int = static_field()

    independent = True

    def __call__(self, key: jax.Array) -> jax.Array:
        """Draw an initial state."""
        x = self.layout.pack(call("initial", self.function, key, self.parameters))
        return jnp.tile(x, self.copies)[None]


@pytree_dataclass
class Given:
    """An initial state that is known; its numbers are as precise as those of the run."""

    state: Any
    layout: Layout = static_field()
    copies: int = static_field()

    independent = True

    def __call__(self, key: jax.Array) -> jax.Array:
        """Return the state, ``[1, D]``."""
        return jnp.tile(self.layout.pack(self.state), self.copies)[None]


@pytree_dataclass
class FunctionDynamics(contract.Dynamics):
    """Dynamics from plain functions; a substate is the flattened state, or state and predecessor.

    The methods ``log_density``, ``at_frame`` and ``with_inputs`` exist only if the functions need
    them.
    """

    parameters: Any
    transition: Callable = static_field()
    density: Callable | None = static_field()
    layout: Layout = static_field()
    copies: int = static_field()
    inputs: Any = None
    frame: Any = None

    def propagate(self, key, partition, current, previous, parent):
        """Draw the new substate ``[D]``."""
        x = self.layout.unpack(current)
        extras = extras_of(self.transition, self.frame, lambda: self.layout.unpack(previous))
        new = call("transition", self.transition, key, x, self.parameters, **extras)
        new = self.layout.pack(new)
        return new if self.copies == 1 else jnp.concatenate([new, current[: self.layout.size]])

    @property
    def log_density(self):
        """Log of the density ``[]`` from which ``propagate`` draws."""
        density = self.density
        if density is None:
            raise AttributeError("log_density")

        def log_density(partition, new, current, previous, parent):
            states = (self.layout.unpack(x) for x in (new, current))
            extras = extras_of(density, self.frame, lambda: self.layout.unpack(previous))
            name = "transition_log_density"
            return jnp.reshape(call(name, density, *states, self.parameters, **extras), ())

        return log_density

    @property
    def at_frame(self):
        """Return the dynamics that lead to a frame."""
        return _at_frame(self, self.transition, self.density)

    @property
    def with_inputs(self):
        """Return the dynamics with known inputs."""
        return _with_inputs(self, self.transition, self.density)


@pytree_dataclass
class FunctionProposal(WrappedProposal):
    """A proposal of the state, for substates that hold the state and its predecessor."""

    proposal: Any

    def of_model(self, dynamics, likelihood):
        """See ``jaxpf.contract.Proposal``."""
        of_state = dataclasses.replace(dynamics, copies=1)
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
class FunctionLikelihood(contract.Likelihood):
    """A likelihood from a plain function."""

    parameters: Any
    function: Callable = static_field()
    layout: Layout = static_field()
    observation: Callable | None = static_field(default=None)
    first_stage: Callable | None = static_field(default=None)
    inputs: Any = None
    frame: Any = None

    @property
    def handles_nan(self):
        """Whether the function declares that it understands NaN."""
        return optional(self.function, "handles_nan")

    @property
    def at_frame(self):
        """Return the likelihood of a frame."""
        return _at_frame(self, self.function, self.observation, self.first_stage)

    @property
    def with_inputs(self):
        """Return the likelihood with known inputs."""
        return _with_inputs(self, self.function, self.observation, self.first_stage)

    def log_prob(self, observation, partition, substate):
        """Log-likelihood ``[]`` of a substate ``[D]``."""
        name = "log_likelihood"
        value = jnp.reshape(self._called(name, self.function, observation, substate), ())
        outside = self.layout.is_outside(self.layout.unpack(substate))
        return value if outside is False else jnp.where(outside, jnp.nan, value)

    @property
    def log_first_stage(self):
        """Log of a first-stage weight; exists only with ``first_stage``."""
        if self.first_stage is None:
            raise AttributeError("log_first_stage")
        return lambda observation, substates: jnp.reshape(
            self._called("first_stage", self.first_stage, observation, substates[0]), ()
        )

    @property
    def sample(self):
        """Draw a frame, given substates ``[1, D]``; exists only with an ``observation``."""
        if self.observation is None:
            raise AttributeError("sample")
        return lambda key, substates: jax.tree.map(
            jnp.asarray, self._called("observation", self.observation, key, substates[0])
        )

    def _called(self, name: str, function: Callable, first: Any, substate: jax.Array) -> Any:
        """Call a function with the state of a substate ``[D]``, and what it asks for."""
        previous = substate[self.layout.size :]
        extras = extras_of(function, self.frame, lambda: self.layout.unpack(previous))
        x = self.layout.unpack(substate)
        return call(name, function, first, x, self.parameters, **extras)


def _at_frame(part: Any, *functions: Callable | None) -> Callable:
    """``part.at_frame``, which exists only if a function asks for the time or for an input."""
    if not any(asks_for(f, name) for f in functions for name in ("time", "u")):
        raise AttributeError("at_frame")

    def at_frame(time: ArrayLike) -> Any:
        frame = {"time": time}
        if part.inputs is not None:
            values, first = part.inputs
            frame["u"] = jax.tree.map(
                lambda x: lax.dynamic_index_in_dim(jnp.asarray(x), time - first, keepdims=False),
                values,
            )
        return dataclasses.replace(part, frame=frame)

    return at_frame


def _with_inputs(part: Any, *functions: Callable | None) -> Callable:
    """``part.with_inputs``, which exists only if a function asks for an input."""
    if not any(asks_for(function, "u") for function in functions):
        raise AttributeError("with_inputs")
    return lambda inputs, first: dataclasses.replace(part, inputs=(inputs, first))
