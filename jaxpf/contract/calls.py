"""How the library calls what users write; the one place that looks up what is optional there."""

import copy
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.interface import (
    CoupledDynamics,
    Dynamics,
    DynamicsWithDensity,
    DynamicsWithPrediction,
    Likelihood,
    Proposal,
)
from jaxpf.contract.pytree import T
from jaxpf.contract.types import DynamicsLike, LikelihoodLike, ProposalLike, TrackerLike

#: Least log of a first-stage weight, relative to the largest.
_LEAST_FIRST_STAGE = -30.0
#: What a part without one counts as having, see ``jaxpf.contract.interface``; None for the others.
DEFAULTS: dict[str, Any] = {
    "by_partition": (),
    "coupled": False,
    "evidence_biases": (),
    "fixed_observation": False,
    "handles_nan": False,
    "independent": False,
    "model_error": (0.0, 0.0, 0.0),
    "needs_noise": False,
    "state_gradient": True,
}


def optional(part: object, name: str) -> Any:
    """An optional method or attribute of a part; if it has none, the one in ``DEFAULTS``."""
    return getattr(part, name, DEFAULTS.get(name))


def unwrapped(tracker: Any, having: str = "likelihood") -> Any:
    """The outermost of a tracker and those that it wraps with an attribute, else the innermost."""
    while not hasattr(tracker, having) and hasattr(tracker, "tracker"):
        tracker = tracker.tracker
    return tracker


def likelihood_of(tracker: Any) -> Any:
    """The likelihood of a tracker or of the filter that it wraps; None if there is none."""
    return getattr(unwrapped(tracker), "likelihood", None)


def observed_apart(tracker: Any) -> tuple[Callable, Callable]:
    """Split a step into the work that depends on the frame alone, and the rest."""
    if hasattr(tracker, "observe") and hasattr(tracker, "step_observed"):
        return tracker.observe, tracker.step_observed
    return (lambda frame: frame), tracker.step


def time_of(state: Any) -> jax.Array:
    """Number of frames that led to a state, ``[]`` int32; see ``Tracker``.

    Raises:
        InputError: the state does not say, so that it cannot be resumed.
    """
    if getattr(state, "time", None) is None:
        raise InputError(
            f"{type(state).__name__} has no field time, so resuming would repeat the random "
            "numbers of the first frames; let the state hold time, one integer that init sets to 0 "
            "and every step increases by 1."
        )
    return state.time


def moments(tracker: TrackerLike, values: jax.Array) -> Any:
    """Name means or standard deviations ``[..., P, D]``, if the tracker's states are pytrees."""
    return tracker.moments(values) if hasattr(tracker, "moments") else values


def states(tracker: TrackerLike, substates: jax.Array | None) -> Any:
    """Return substates ``[..., P, D]`` as the tracker's states, if those are pytrees."""
    return tracker.states(substates) if hasattr(tracker, "states") else substates


def frame_of(observations: Any, place: jax.Array) -> Any:
    """Take one frame's observation from a stack of observations.

    Nodes with a method ``take_frame`` index themselves, which avoids copying a large table.
    """

    def finds_itself(x):
        return hasattr(x, "take_frame")

    def take(x):
        if finds_itself(x):
            return x.take_frame(place)
        return lax.dynamic_index_in_dim(x, place, keepdims=False)

    return jax.tree.map(take, observations, is_leaf=finds_itself)


def propagate_all(dynamics, key, partition, current, previous, parent, *others) -> jax.Array:
    """Move all particles, ``[D, N]``, with the batched method if defined."""
    base = CoupledDynamics if is_coupled(dynamics) else Dynamics
    method = method_of(dynamics, base, "propagate_all")
    return method(key, partition, current, previous, parent, *others)


def is_coupled(dynamics: DynamicsLike) -> bool:
    """Whether motion depends on the whole previous state, see ``CoupledDynamics``."""
    return optional(dynamics, "coupled")


def at_frame(tracker: T, time: ArrayLike) -> T:
    """Return the tracker with the dynamics, the likelihood and the proposal of frame ``time``.

    Frames are counted from 0.  A part without ``at_frame`` stays unchanged.
    """
    return _parts_changed(tracker, "at_frame", time)


def with_inputs(tracker: T, inputs: Any, first: ArrayLike = 0) -> T:
    """Return the tracker with known inputs of its model, such as controls or frame intervals.

    Dynamics, likelihoods and proposals that take inputs define ``with_inputs(inputs, first)``;
    their ``at_frame(time)`` reads row ``time - first``.  Inputs are a pytree of arrays
    ``[T, ...]``, a row for each frame from ``first`` on; None changes nothing.
    """
    if inputs is None:
        return tracker
    changed = _parts_changed(tracker, "with_inputs", inputs, first)
    if changed is tracker:
        raise InputError(
            f"{type(tracker).__name__} takes no inputs; let a function of jaxpf.state_space have "
            "an argument u, or leave out inputs."
        )
    return changed


def _parts_changed(tracker: T, method: str, *arguments: Any) -> T:
    """Replace the parts of the model by what their optional method returns."""
    for name in ("dynamics", "likelihood", "proposal"):
        if optional(getattr(unwrapped(tracker, name), name, None), method):
            tracker = changed_inside(tracker, name, lambda part: getattr(part, method)(*arguments))
    return tracker


def of_frame(part: T, time: ArrayLike) -> T:
    """Return dynamics or a likelihood for frame ``time``; unchanged without ``at_frame``."""
    return part.at_frame(time) if hasattr(part, "at_frame") else part


def first_motion(dynamics: T) -> T:
    """Return the dynamics leading to frame 0; unchanged if they have no ``at_frame``."""
    return of_frame(dynamics, 0)


def handles_nan(tracker: TrackerLike) -> bool:
    """Whether a tracker's likelihood declares that it understands NaN, see ``Likelihood``."""
    return bool(optional(likelihood_of(tracker), "handles_nan"))


def changed_inside(tracker: Any, name: str, change: Callable[[Any], Any]) -> Any:
    """Return a copy with one field changed, of the tracker or of the tracker that it wraps.

    Bypasses the constructor, which would repeat its checks on traced values.
    """
    changed = copy.copy(tracker)
    if hasattr(tracker, name):
        object.__setattr__(changed, name, change(getattr(tracker, name)))
    else:
        object.__setattr__(changed, "tracker", changed_inside(tracker.tracker, name, change))
    return changed


def check_factors(dynamics: DynamicsLike, likelihood: LikelihoodLike, holder: str) -> None:
    """Refuse a model that does not factor over partitions, for particles that hold one each."""
    check_uncoupled(dynamics, f"{holder} that hold one object each")
    if has_log_joint(likelihood):
        raise InputError(
            f"{type(likelihood).__name__} weighs all objects together (log_joint), and {holder} "
            "hold one of them each; choose method sir, ps, dps or sps (jaxpf.Partitioned)."
        )


def check_uncoupled(dynamics: DynamicsLike, what: str | Argument) -> None:
    """Refuse coupled dynamics if ``what`` splits particles or does not keep whole states.

    Raises:
        InputError: the dynamics are coupled; the message names ``what``.
    """
    if is_coupled(first_motion(dynamics)):
        raise InputError(*coupled_with(dynamics, what))


def coupled_with(dynamics: DynamicsLike, what: str | Argument) -> tuple[str | Argument, ...]:
    """The pieces of the message of ``check_uncoupled``."""
    return (
        f"{type(dynamics).__name__} moves a partition by all the others, which does not work with ",
        what,
        "; use jaxpf.Partitioned with sir, ps or dps, or dynamics of single partitions.",
    )


def has_log_density(dynamics: DynamicsLike) -> bool:
    """Whether the dynamics define their transition density."""
    dynamics = first_motion(dynamics)
    return hasattr(dynamics, "log_density") or hasattr(dynamics, "log_density_all")


def log_density_all(dynamics, partition, new, current, previous, parent) -> jax.Array:
    """Log-densities ``[N]`` of moves to ``new`` ``[D, N]``, from the batched method if defined."""
    method = method_of(dynamics, DynamicsWithDensity, "log_density_all")
    return method(partition, new, current, previous, parent)


def predict_all(dynamics, partition, current, previous) -> jax.Array:
    """Substates ``[D, N]`` moved without noise, by the batched method if defined."""
    method = method_of(dynamics, DynamicsWithPrediction, "predict_all")
    return method(partition, current, previous)


def proposal_of(proposal: ProposalLike, dynamics: DynamicsLike, likelihood: LikelihoodLike) -> Any:
    """Give the proposal its model if it defines ``of_model``."""
    return proposal.of_model(dynamics, likelihood) if hasattr(proposal, "of_model") else proposal


def propose_all(proposal, key, observation, partition, current, previous, parent) -> jax.Array:
    """Draw substates ``[D, N]`` from the proposal, with the batched method if defined."""
    method = method_of(proposal, Proposal, "propose_all")
    return method(key, observation, partition, current, previous, parent)


def proposal_log_density_all(
    proposal, observation, partition, new, current, previous, parent
) -> jax.Array:
    """Log-densities ``[N]`` of proposing ``new`` ``[D, N]``, from the batched method if defined."""
    method = method_of(proposal, Proposal, "log_density_all")
    return method(observation, partition, new, current, previous, parent)


def as_seen(likelihood: LikelihoodLike, observation: Any) -> tuple[Any, Any, Any]:
    """Unwrap a likelihood for missing frames: inner likelihood, inner observation, seen mask.

    The mask is bool, ``[]`` or ``[P]``; None means that everything was seen.  Wrappers for missing
    frames define ``as_seen(observation)``.
    """
    unwrap = optional(likelihood, "as_seen")
    return unwrap(observation) if unwrap else (likelihood, observation, None)


def log_prob_all(likelihood, observation, partition, substates) -> jax.Array:
    """Log-likelihoods ``[N]`` of substates ``[D, N]``, from the batched method if defined."""
    method = method_of(likelihood, Likelihood, "log_prob_all")
    return method(observation, partition, substates)


def log_first_stage_all(likelihood, observation, substates) -> jax.Array | None:
    """First-stage log-weights ``[N]`` of particles before they move, ``[D, P, N]``; or None.

    Any positive weights leave the evidence unbiased, so those that are not finite or too small for
    their weights are raised, and a frame that was not seen in full has none.
    """
    likelihood, observation, seen = as_seen(likelihood, observation)
    if seen is np.False_ or not optional(likelihood, "log_first_stage"):
        return None
    weigh = jax.vmap(likelihood.log_first_stage, in_axes=(None, 2))
    values = lax.stop_gradient(weigh(observation, jnp.swapaxes(substates, 0, 1)))
    values = jnp.where(jnp.isfinite(values), values, -jnp.inf)
    largest = jnp.max(values)
    values = jnp.maximum(values - jnp.where(jnp.isfinite(largest), largest, 0), _LEAST_FIRST_STAGE)
    values = values.astype(substates.dtype)
    return values if seen is None else jnp.where(jnp.all(seen), values, 0)


def has_log_joint(likelihood: LikelihoodLike) -> bool:
    """Whether the likelihood does not factor over partitions."""
    return hasattr(likelihood, "log_joint") or hasattr(likelihood, "log_joint_labelled")


def log_joint_all(likelihood, observation, substates, log_probs, label=None) -> jax.Array:
    """Joint log-likelihoods ``[N]`` of substates ``[D, P, N]``, given ``log_probs`` ``[P, N]``.

    Passes labels ``[N]`` if particles carry them and the likelihood defines
    ``log_joint_labelled``.  Uses the batched method if defined.
    """
    arguments = [observation, jnp.swapaxes(substates, 0, 1), log_probs]
    name = "log_joint"
    if label is not None and hasattr(likelihood, "log_joint_labelled"):
        name, arguments = "log_joint_labelled", [*arguments, label]
    if hasattr(likelihood, f"{name}_all"):
        return getattr(likelihood, f"{name}_all")(*arguments)
    axes = (None, 2, 1, 0)[: len(arguments)]
    return jax.vmap(getattr(likelihood, name), in_axes=axes)(*arguments)


def propagate_label_all(dynamics, key, label, substates) -> jax.Array:
    """Labels ``[N]`` of the next frame, given substates ``[D, P, N]``.

    Labels stay the same without ``propagate_label``.
    """
    if not hasattr(dynamics, "propagate_label"):
        return label
    keys = jax.random.split(key, label.shape[0])
    moved = jax.vmap(dynamics.propagate_label, in_axes=(0, 0, 2))(
        keys, label, jnp.swapaxes(substates, 0, 1)
    )
    return moved.astype(label.dtype)


def has_log_label(dynamics: DynamicsLike) -> bool:
    """Whether the dynamics define the transition probabilities of labels.

    The method ``log_label(new [], label [], substates [P, D]) -> []`` returns the log-probability
    with which ``propagate_label`` draws ``new``.  ``jaxpf.smooth`` needs it; there is no default.
    """
    return hasattr(first_motion(dynamics), "log_label")


def log_label(dynamics, new, label, substates) -> jax.Array:
    """Log-probability ``[]`` of a label's transition; labels stay without ``propagate_label``."""
    if not hasattr(dynamics, "propagate_label"):
        return jnp.where(new == label, 0.0, -jnp.inf)
    return dynamics.log_label(new, label, substates)


def has_log_odds(likelihood: LikelihoodLike) -> bool:
    """Whether a likelihood defines the log odds that an object is at its estimate."""
    return hasattr(likelihood, "log_odds") or hasattr(likelihood, "log_odds_all")


def log_odds_all(likelihood, observation, partition, substates) -> jax.Array:
    """Log odds ``[N]`` of objects being at ``[D, N]``, from the batched method if defined."""
    if hasattr(likelihood, "log_odds_all"):
        return likelihood.log_odds_all(observation, partition, substates)
    return jax.vmap(likelihood.log_odds, in_axes=(None, 0, 1))(observation, partition, substates)


def look_near(likelihood: Any, observation: Any, estimates: Callable[[], jax.Array]) -> Any:
    """The observation, with what a likelihood sees only near the filter's last estimates.

    A likelihood may define ``look_near(observation, estimates [P, D]) -> observation``.  Filters
    call it once per frame and run, so that costly features are computed near the objects alone;
    every other method then gets its result.

    Args:
        likelihood: of the filter.
        observation: from ``observe``.
        estimates: function that returns the estimates of the previous frame, ``[P, D]``.
    """
    look = optional(likelihood, "look_near")
    return look(observation, lax.stop_gradient(estimates())) if look else observation


def observe_nearby(observer: object, frame: Any, near: Any) -> Any:
    """The observation of some parts of a frame, by a tracker or likelihood; None if it has none.

    A quicker ``observe`` for single runs in large frames, with the same results:
    ``observe_nearby(frame, near)`` of a likelihood takes estimates ``[P, D]``, that of a tracker
    its state after the previous frame.  The likelihood of a substate that the parts do not show
    is NaN, and a run repeats the step with ``observe``.
    """
    observe = optional(observer, "observe_nearby")
    return observe(frame, near) if observe else None


def model_error(tracker: TrackerLike, num_partitions: int) -> np.ndarray:
    """Errors ``[P, 3]`` that a tracker's likelihood declares, see ``Likelihood``; else 0."""
    declared = np.array(optional(likelihood_of(tracker), "model_error"), float)
    return np.broadcast_to(declared.reshape(-1, 3), (num_partitions, 3))


def of_partition(values: jax.Array, partition: jax.Array) -> jax.Array:
    """Each particle's row of ``values`` ``[P, ...]``: ``[N, ...]``, or ``[1, ...]`` if P is 1.

    With one partition, broadcasting replaces the look-up because its derivative is much faster:
    one sum instead of a sum over runs for each particle and then a sum over particles.
    """
    return values if values.shape[0] == 1 else values[partition]


def method_of(part: object, base: type, name: str) -> Callable:
    """Return the object's own method, or the base class's default bound to the object."""
    return getattr(part, name, None) or partial(getattr(base, name), part)
