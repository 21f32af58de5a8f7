"""Draws of states and observations from a model: before, during and after the data."""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.contract import calls
from jaxpf.contract.calls import at_frame, likelihood_of, optional
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number, check_whole
from jaxpf.contract.state import ParticleState
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering.programs import compiled
from jaxpf.running.frames import noted
from jaxpf.running.missing_frames import WithoutFrames
from jaxpf.running.runs import as_key, init, one_run, with_rows


class Simulated(NamedTuple):
    """Draws from a model, with a leading axis M if ``num_draws`` was given.

    Attributes:
        states: ``[T, P, D]``, or for states that are pytrees those of ``[T, ...]``.
        frames: ``[T, ...]``, observations.
    """

    states: Any
    frames: Any

    def interval(self, level: float = 0.95) -> tuple[Any, Any]:
        """Ends of the central predictive intervals of the observations, over M draws."""
        return central_interval(self.frames, level, 0)


def central_interval(draws: Any, level: float, axes: int | tuple[int, ...]) -> tuple[Any, Any]:
    """Ends of the intervals that contain the share ``level`` of the draws along some axes."""
    check_number("level", level, least=0, most=1)
    lower, upper = (
        jax.tree.map(partial(jnp.quantile, q=end, axis=axes), draws)
        for end in ((1 - level) / 2, (1 + level) / 2)
    )
    return lower, upper


def simulate(
    tracker: TrackerLike,
    key: jax.Array,
    num_frames: int,
    *,
    state: Any = None,
    num_draws: int | None = None,
    inputs: Any = None,
) -> Simulated:
    """Draw states and observations of T frames from the model.

    With a ``state`` after observed frames, these are predictive draws of what follows::

        state, _ = jaxpf.run(tracker, key, y)
        low, high = jaxpf.simulate(tracker, key, 30, state=state, num_draws=1000).interval(0.95)

    Args:
        tracker: a ``jaxpf.Partitioned`` whose likelihood defines ``sample``, such as a
            ``jaxpf.state_space`` with an ``observation``.
        key: random key.
        num_frames: T.
        state: state to continue from, with its ``time``; a particle is drawn for each draw.  None
            starts with the initial state.
        num_draws: M, number of independent draws; None gives one, without the axis M.
        inputs: known inputs of these T frames, as for ``jaxpf.run``.

    Returns:
        The states and frames, a ``Simulated``.

    Raises:
        InputError: a likelihood without ``sample``, or a number below 1.
    """
    check_whole("num_frames", num_frames)
    if num_draws is not None:
        check_whole("num_draws", num_draws)
    likelihood = likelihood_of(tracker)
    if not optional(likelihood, "sample"):
        raise InputError(
            f"{type(likelihood).__name__} draws no observations; write its method sample(key, "
            "substates [P, D]), or give jaxpf.state_space an observation."
        )
    first = 0 if state is None else calls.time_of(state)
    tracker = with_rows(tracker, inputs, num_frames, first)
    with noted(tracker):
        drawn = _simulated(tracker, as_key(key), state, num_frames, num_draws or 1)
    return drawn if num_draws is not None else jax.tree.map(lambda x: x[0], drawn)


@partial(compiled, static_argnums=(3, 4))
def _simulated(tracker, key, state, num_frames, num_draws) -> Simulated:
    """Filters of one particle each, in which all frames are missing."""
    one = calls.changed_inside(tracker, "num_particles", lambda _: 1)
    blind, unseen = WithoutFrames(one), (np.False_, np.False_)
    keys = jax.random.split(key, 1 + num_draws)
    chosen = jnp.zeros(num_draws, jnp.int32)
    if state is not None:
        chosen = jax.random.categorical(keys[0], state.log_weights, shape=(num_draws,))
    times = (0 if state is None else state.time) + jnp.arange(num_frames)

    def draw(key: jax.Array, chosen: jax.Array) -> Simulated:
        move_key, seen_key = jax.random.split(key)
        step = one_run(blind, move_key, lambda state, _: state.substates[0])

        def advance(state: Any, time: jax.Array) -> Any:
            state, substates = step(state, (time, unseen))
            likelihood = likelihood_of(at_frame(one, time))
            frame = likelihood.sample(jax.random.fold_in(seen_key, time), substates)
            return state, Simulated(calls.states(tracker, substates), frame)

        start = init(one, move_key) if state is None else _of_particle(state, chosen)
        return lax.scan(advance, start, times)[1]

    return jax.vmap(draw)(keys[1:], chosen)


def _of_particle(state: ParticleState, index: jax.Array) -> ParticleState:
    """One particle of a state, as a state."""
    names = ("lagged", "log_weights", "lineage", "component", "path_scores", "label", "sources")
    kept = {name: getattr(state, name) for name in names}
    kept = {name: x[..., index, None] for name, x in kept.items() if x is not None}
    zeros = {name: jnp.zeros_like(kept[name]) for name in ("log_weights", "lineage")}
    return dataclasses.replace(state, **kept | zeros)
