"""Particle Gibbs: a Markov chain of trajectories from the posterior given all frames.

Backward simulation can only use the filter's particles.  After a long occlusion, few particles lead
to the place where the object reappears.  A *conditional sweep* keeps a reference trajectory among
its particles and draws a new trajectory.  It leaves the posterior of trajectories given all frames
invariant at any number of particles (Andrieu, Doucet & Holenstein 2010).  A sequence of sweeps,
each with the previous draw as its reference, converges to this posterior.

*Ancestor sampling* (Lindsten, Jordan & Schoen 2014) redraws the past of the reference x' at every
frame, by ::

    w_t f(x'_{t+1} | x_t, x_{t-1}) f(x'_{t+2} | x'_{t+1}, x_t)

without the second factor for first-order motion and at the second-to-last frame.  It takes place at
the start of a frame, for all partitions at once.  Inside a frame the reference keeps its own past,
because no rule has been proved for the partitions still to be processed.
"""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import at_frame, optional
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.refusals import poisoned, refused
from jaxpf.contract.wrapped import offered
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.gradients import NoGradient
from jaxpf.lowering.programs import compiled
from jaxpf.resampling.schemes import BuiltIn
from jaxpf.running import missing_frames, runs
from jaxpf.running.frames import num_frames
from jaxpf.smoothing.backward import Drawn, History, draw_paths, log_densities
from jaxpf.smoothing.checks import check_smoothing, looks_back


@pytree_dataclass
class _KeepsFirst(BuiltIn):
    """Multinomial resampling in which the first slot keeps its particle."""

    def within(self, key, cdf, components):
        return super().within(key, cdf, components).at[0].set(0)


@pytree_dataclass
class _HoldsFirst:
    """Dynamics or a proposal in which the first particle follows a reference ``[D, P]``."""

    inner: Any
    reference: jax.Array

    def __getattr__(self, name):
        """The densities are the inner ones."""
        return offered(self, "inner", name)

    def propagate_all(self, key, partition, *past):
        moved = contract.propagate_all(self.inner, key, partition, *past)
        return moved.at[:, 0].set(self.reference[:, partition[0]])

    def propose_all(self, key, observation, partition, *past):
        drawn = calls.propose_all(self.inner, key, observation, partition, *past)
        return drawn.at[:, 0].set(self.reference[:, partition[0]])

    def of_model(self, dynamics, likelihood):
        return _HoldsFirst(calls.proposal_of(self.inner, dynamics, likelihood), self.reference)


def particle_gibbs(
    tracker: Partitioned,
    key: jax.Array,
    frames: Any,
    num_sweeps: int,
    reference: ArrayLike | None = None,
    *,
    observed: Any = None,
    inputs: Any = None,
) -> jax.Array:
    """Draw trajectories by conditional sweeps, each given the previous trajectory.

    Args:
        tracker: a ``jaxpf.Partitioned`` with ``resampling="multinomial"``, an ordering from ``sir``
            or ``ps``, and dynamics with ``log_density``.  The draws are right for any number of
            particles, and mix faster with more.
        key: a random key.
        frames: ``[T, ...]``, as for ``jaxpf.run``.
        num_sweeps: S.
        reference: ``[T + 1, P, D]``, the initial trajectory, starting with the substates just
            before the first frame.  None draws it with the filter; the first sweeps still depend on
            it.
        observed: as for ``jaxpf.run``.
        inputs: as for ``jaxpf.run``.

    Returns:
        ``[S, T + 1, P, D]``, trajectories that start just before the first frame.

    Raises:
        InputError: a tracker that cannot be smoothed (``check_smoothing``) or has no conditional
            sweep (``check_conditional``); an iterable of single frames; a reference of a wrong
            shape; fewer than one sweep; inputs that do not fit (``jaxpf.run``).
    """
    marked, frames = runs.ready(tracker, frames, observed, inputs)
    tracker = missing_frames.unmarked(marked)
    refuse = check_conditional(tracker)
    check_whole("num_sweeps", num_sweeps)
    length = num_frames(frames)
    lagged = jax.eval_shape(tracker.init, jax.random.key(0)).lagged
    _, dimension, num_partitions, _ = lagged.shape
    key, first_key = jax.random.split(runs.as_key(key))
    second_order = looks_back(tracker)
    if reference is None:
        reference = _sweep_compiled(marked, first_key, frames, None, second_order)
    wanted = length + 1, num_partitions, dimension
    if np.shape(reference) != wanted:
        raise InputError(
            f"reference has shape {list(np.shape(reference))} instead of {list(wanted)}, T + 1, P "
            "and D; put the substates just before the first frame in front."
        )
    keys = jax.random.split(key, num_sweeps)
    drawn = _sweeps(marked, keys, frames, jnp.asarray(reference), second_order)
    return poisoned(refuse, drawn)


def check_conditional(tracker: Partitioned) -> jax.Array | None:
    """Refuse trackers for which no conditional sweep has been proved.

    Returns:
        As ``check_smoothing``.

    Raises:
        InputError: names the setting and an alternative.
    """
    refuse = check_smoothing(tracker)
    if getattr(tracker.resampling, "name", "") != "multinomial":
        raise InputError(
            f"conditional SMC is implemented for multinomial resampling only, not for "
            f"{tracker.resampling}; give resampling='multinomial'."
        )
    for name, without in (
        ("ess_threshold", None),
        ("tempering", None),
        ("initial_label", None),
        ("joint_weighting", False),
    ):
        if getattr(tracker, name) is not without:
            raise InputError(
                f"conditional SMC has not been proved valid with {name}; leave it out."
            )
    if optional(tracker.likelihood, "look_near"):
        raise InputError(
            f"conditional SMC has not been proved valid with {type(tracker.likelihood).__name__}, "
            "which looks near the particles' mean; use a likelihood of the frame alone."
        )
    ordering = tracker.ordering
    one_component = (
        "a conditional sweep keeps its reference in one component without exchange; use "
        "jaxpf.ordering.ps or sir."
    )
    return refused(
        (refuse, ()),
        (ordering.divides | ordering.exchanges | ordering.keeps_components, [one_component]),
    )


@partial(compiled, static_argnames="second_order")
def _sweeps(tracker, keys, frames, reference, second_order):
    def step(reference, key):
        drawn = sweep(tracker, key, frames, reference, second_order)
        return drawn, drawn

    return lax.scan(step, reference, keys)[1]


def sweep(
    tracker: Any, key: jax.Array, frames: Any, reference: Any, second_order: bool
) -> jax.Array:
    """Draw a trajectory ``[T + 1, P, D]`` given a reference, or from the filter if it is None.

    Args:
        tracker: as returned by ``missing_frames.marked``.
        key: a random key.
        frames: as returned by ``missing_frames.marked``.
        reference: ``[T + 1, P, D]``.
        second_order: static, whether moves depend on the substate before the current one.
    """
    model = missing_frames.unmarked(tracker)
    length = num_frames(frames)
    parts, parents = jnp.arange(model.num_partitions), jnp.asarray(model.parents, jnp.int32)
    slots = jnp.arange(model.num_particles, dtype=jnp.int32)
    init_key, end_key, frames_key = jax.random.split(key, 3)

    start = model.init(init_key)
    start = dataclasses.replace(start, sources=jnp.zeros(start.lineage.shape, jnp.int32))
    if reference is not None:
        reference = jnp.swapaxes(reference, 1, 2).astype(start.lagged.dtype)  # [T + 1, D, P]
        start = dataclasses.replace(start, lagged=start.lagged.at[..., 0].set(reference[0]))

    def one_frame(state, item):
        frame, time, key = item
        if reference is None:
            state, _ = at_frame(tracker, time).step(key, state, frame)
            return state, (state.lagged[0], state.sources)
        key, ancestor_key = jax.random.split(key)
        following = reference[time + 1]
        after = reference[jnp.minimum(time + 2, length)]
        previous, after = (state.lagged[1], after) if second_order else (None, None)
        here = History(state.lagged[0], previous, state.log_weights, None)
        drawn, frames_left = Drawn(following, after, None), length - time
        moves = state.log_weights + log_densities(
            model, here, drawn, parts, parents, frames_left, time - 1
        )
        moves = jnp.where(jnp.isnan(moves), -jnp.inf, moves)
        ancestor = jax.random.categorical(ancestor_key, moves).astype(jnp.int32)
        # The reference continues from slot 0: swap its new past into that slot.
        places = slots.at[0].set(ancestor).at[ancestor].set(0)
        state = dataclasses.replace(
            state, lagged=state.lagged[..., places], log_weights=state.log_weights[places]
        )
        at_time = at_frame(model, time)
        holding = dataclasses.replace(
            at_time,
            dynamics=_HoldsFirst(at_time.dynamics, following),
            proposal=None if at_time.proposal is None else _HoldsFirst(at_time.proposal, following),
            resampling=_KeepsFirst("multinomial"),
            gradient=NoGradient(),
            motion_gradient="pathwise",
        )
        if tracker is not model:
            holding = dataclasses.replace(tracker, tracker=holding)
        state, _ = holding.step(key, state, frame)
        return state, (state.lagged[0], places[state.sources])

    items = frames, jnp.arange(length), jax.random.split(frames_key, length)
    state, later = lax.scan(one_frame, start, items)
    history = jax.tree.map(
        lambda x, y: jnp.concatenate([x[None], y]), (start.lagged[0], start.sources), later
    )
    return draw_paths(end_key, *history, state.log_weights, 1)[0]


_sweep_compiled = compiled(sweep, static_argnums=4)
