"""The interface of trackers, dynamics, likelihoods and proposals: required and optional methods.

All are registered pytrees; ``jaxpf.pytree_dataclass`` registers a class.  Inheritance is optional:
a class only needs the documented methods, about ten lines written for one particle.  The base
classes derive the remaining methods.

============  ===========================================================  =====================
              required                                                     optional
============  ===========================================================  =====================
tracker       ``init``, ``step`` (or ``observe`` with ``step_observed``)   ``num_partitions``
dynamics      ``propagate`` or ``propagate_all``                           ``log_density``,
                                                                           ``log_density_all``,
                                                                           ``predict``,
                                                                           ``predict_all``,
                                                                           ``propagate_label``,
                                                                           ``log_label``,
                                                                           ``coupled``,
                                                                           ``at_frame``
likelihood    ``observe``, ``log_prob`` or ``log_prob_all``                ``log_joint``,
                                                                           ``log_joint_labelled``,
                                                                           ``state_gradient``,
                                                                           ``fixed_observation``,
                                                                           ``form``,
                                                                           ``expecting``,
                                                                           ``log_odds``
proposal      ``propose`` or ``propose_all``,                              ``of_model``
              ``log_density`` or ``log_density_all``
observation   any pytree                                                   ``take_frame``
sampler       ``__call__(key) -> [P, D]``                                  ``independent``
============  ===========================================================  =====================

Only the functions at the end of this module look up optional methods.
"""

import copy
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.contract.errors import InputError


class Tracker:
    """Tracks P targets from frame to frame.

    The state is any pytree.  The summary should be a ``jaxpf.Summary``; optional fields that the
    filter does not compute are None.  Evaluation and tuning read ``num_partitions``, P, and
    ``summary.estimate``, ``[P, D]``.

    Define ``init`` and ``step_observed``, plus ``observe`` if runs can share work.  If they
    cannot, define ``init`` and ``step``.
    """

    def init(self, key: jax.Array) -> Any:
        """Return the state just before the first frame."""
        raise TypeError(f"{type(self).__name__} must define init")

    def observe(self, frame: Any) -> Any:
        """Do the work that depends on the frame alone, once per frame for all runs."""
        return frame

    def step_observed(self, key: jax.Array, state: Any, observation: Any) -> tuple[Any, Any]:
        """Return the next state and the frame's summary, given the result of ``observe``."""
        if type(self).observe is not Tracker.observe:
            raise TypeError(f"{type(self).__name__} must define step_observed, as it has observe")
        _check_defined(self, Tracker, "step", "step_observed")
        return self.step(key, state, observation)  # the observation is the frame itself

    def step(self, key: jax.Array, state: Any, frame: Any) -> tuple[Any, Any]:
        """Return the next state and the frame's summary.

        Args:
            key: this frame's random key; ``jaxpf.run`` uses ``fold_in(key, t)``, t from 1.
            state: state after the previous frame.
            frame: the argument of ``observe``.
        """
        return self.step_observed(key, state, self.observe(frame))


class Dynamics:
    """The motion model of a substate.  Define ``propagate``, or ``propagate_all``.

    ``propagate_all`` is faster: it draws the noise of all particles from one key, while
    ``propagate`` gets a key per particle.

    A part's motion must depend only on its own past and on its parent.  The exchanges of
    ``jaxpf.ordering.sps`` rely on this: they trade a part together with its descendants, but not
    with any other part that it depends on.  For motion that depends on all partitions of the
    previous frame, see ``CoupledDynamics``.

    For motion that changes with time, define ``at_frame(time []) -> dynamics``, which returns the
    dynamics leading to frame ``time``, counted from 0.  It can index an array ``[T, ...]`` of
    known camera positions or of uneven frame intervals, for example.  There is no default.
    """

    def propagate(
        self,
        key: jax.Array,
        partition: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
    ) -> jax.Array:
        """Draw the new substate ``[D]``; ``parent`` ``[D]`` is already moved, zeros for a root."""
        _check_defined(self, Dynamics, "propagate", "propagate_all")
        columns = (x[:, None] for x in (current, previous, parent))
        return self.propagate_all(key, jnp.asarray(partition)[None], *columns)[:, 0]

    def propagate_all(
        self,
        key: jax.Array,
        partition: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
    ) -> jax.Array:
        """``propagate`` for N particles: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, Dynamics, "propagate", "propagate_all")
        keys = jax.random.split(key, partition.shape[0])
        return jax.vmap(self.propagate, in_axes=(0, 0, 1, 1, 1), out_axes=1)(
            keys, partition, current, previous, parent
        )


class CoupledDynamics:
    """Dynamics in which a partition's motion depends on all partitions of the previous frame.

    Examples are pedestrians avoiding each other, or a chaotic system on a grid.  Define
    ``propagate`` or ``propagate_all`` as for ``Dynamics``, with one more argument: ``others``, the
    particle's whole state in the previous frame; ``current`` is the partition's own entry.
    Requires ``jaxpf.Partitioned`` without exchange, whose particles hold whole states.
    """

    coupled = True

    def propagate(
        self,
        key: jax.Array,
        partition: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
        others: jax.Array,
    ) -> jax.Array:
        """Draw the new substate ``[D]``, given ``others`` ``[P, D]``."""
        _check_defined(self, CoupledDynamics, "propagate", "propagate_all")
        columns = (x[..., None] for x in (current, previous, parent, others))
        return self.propagate_all(key, jnp.asarray(partition)[None], *columns)[:, 0]

    def propagate_all(
        self,
        key: jax.Array,
        partition: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
        others: jax.Array,
    ) -> jax.Array:
        """``propagate`` for N particles, ``[D, N]``, given ``others`` ``[P, D, N]``."""
        _check_defined(self, CoupledDynamics, "propagate", "propagate_all")
        keys = jax.random.split(key, partition.shape[0])
        return jax.vmap(self.propagate, in_axes=(0, 0, 1, 1, 1, 2), out_axes=1)(
            keys, partition, current, previous, parent, others
        )


class DynamicsWithDensity(Dynamics):
    """Dynamics with a known density, for ``jaxpf.smooth`` and ``motion_gradient="score"``.

    Define ``log_density`` or ``log_density_all``; each defaults to the other.
    """

    def log_density(
        self,
        partition: jax.Array,
        new: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
    ) -> jax.Array:
        """Log of the density ``[]`` from which ``propagate`` draws ``new`` ``[D]``.

        Leave out dimensions without noise: they have no density, and ``new`` is assumed to follow
        the deterministic motion there.
        """
        _check_defined(self, DynamicsWithDensity, "log_density", "log_density_all")
        columns = (x[:, None] for x in (new, current, previous, parent))
        return self.log_density_all(jnp.asarray(partition)[None], *columns)[0]

    def log_density_all(
        self,
        partition: jax.Array,
        new: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
    ) -> jax.Array:
        """``log_density`` for N particles, ``[N]``: substates ``[D, N]``."""
        _check_defined(self, DynamicsWithDensity, "log_density", "log_density_all")
        return jax.vmap(self.log_density, in_axes=(0, 1, 1, 1, 1))(
            partition, new, current, previous, parent
        )


class DynamicsWithPrediction(Dynamics):
    """Dynamics that predict a root's substate, for ``Partitioned(look_ahead=True)``.

    Define ``predict`` or ``predict_all``; each defaults to the other.
    """

    def predict(self, partition: jax.Array, current: jax.Array, previous: jax.Array) -> jax.Array:
        """Return the new substate ``[D]`` without noise."""
        _check_defined(self, DynamicsWithPrediction, "predict", "predict_all")
        return self.predict_all(jnp.asarray(partition)[None], current[:, None], previous[:, None])[
            :, 0
        ]

    def predict_all(
        self, partition: jax.Array, current: jax.Array, previous: jax.Array
    ) -> jax.Array:
        """``predict`` for N particles: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, DynamicsWithPrediction, "predict", "predict_all")
        return jax.vmap(self.predict, in_axes=(0, 1, 1), out_axes=1)(partition, current, previous)


class Likelihood:
    """The observation model.  Define ``log_prob`` or ``log_prob_all``.

    These methods are optional and have no default:

    * ``log_joint(observation, substates [P, D], log_probs [P]) -> []``: the log-likelihood of all
      partitions together.  Define it only if the likelihood does not factor over partitions;
      ``log_prob`` is then the weighting function of each stage.
    * ``log_joint_labelled(observation, substates [P, D], log_probs [P], label []) -> []``: the
      same, if it also depends on the particle's label.  Used when particles carry labels.
    * ``log_joint_all`` and ``log_joint_labelled_all``: the same for all particles at once, with
      ``substates [P, D, N]``, ``log_probs [P, N]``, ``label [N]`` and result ``[N]``.
    * ``estimated_nanoseconds(frame_shape) -> (float, float)``: the time of ``observe``, and of
      one ``log_prob``.  Evaluations plan their work by it.
    """

    #: Whether ``log_prob`` has a useful derivative in the substate.  A likelihood that reads whole
    #: pixels has derivative 0 almost everywhere.
    state_gradient: Any = True
    #: Whether the observation depends on the frame alone, not on any parameter.
    fixed_observation: Any = False
    #: For likelihoods of a distance, its form (``jaxpf.likelihoods.log_density``); else None.
    form: Any = None

    def observe(self, frame: Any) -> Any:
        """Return what ``log_prob`` needs of a frame, computed once for all runs and particles.

        The result is any pytree.  A large node may have a method ``take_frame(index)``, see
        ``frame_of``.
        """
        return frame

    def log_prob(self, observation: Any, partition: jax.Array, substate: jax.Array) -> jax.Array:
        """Log-likelihood ``[]`` of one partition's substate ``[D]``."""
        _check_defined(self, Likelihood, "log_prob", "log_prob_all")
        return self.log_prob_all(observation, jnp.asarray(partition)[None], substate[:, None])[0]

    def log_prob_all(
        self, observation: Any, partition: jax.Array, substates: jax.Array
    ) -> jax.Array:
        """``log_prob`` for N particles, ``[N]``: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, Likelihood, "log_prob", "log_prob_all")
        return jax.vmap(self.log_prob, in_axes=(None, 0, 1))(observation, partition, substates)


class Proposal:
    """Draws substates given the frame, in place of the dynamics.

    Used by ``jaxpf.Partitioned(proposal=...)``; the dynamics need ``log_density``.  Define
    ``propose`` or ``propose_all``, and ``log_density`` or ``log_density_all``.  The proposal
    density must be positive wherever the transition density is.  If the proposal needs the model's
    dynamics or likelihood, also define ``of_model(dynamics, likelihood) -> proposal``, called in
    every frame; there is no default.
    """

    def propose(self, key, observation, partition, current, previous, parent) -> jax.Array:
        """Draw the new substate ``[D]``; ``parent`` ``[D]`` is already moved, zeros for a root."""
        _check_defined(self, Proposal, "propose", "propose_all")
        columns = (x[:, None] for x in (current, previous, parent))
        return self.propose_all(key, observation, jnp.asarray(partition)[None], *columns)[:, 0]

    def propose_all(self, key, observation, partition, current, previous, parent) -> jax.Array:
        """``propose`` for N particles, ``[D, N]``: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, Proposal, "propose", "propose_all")
        keys = jax.random.split(key, partition.shape[0])

        def propose(*arguments):
            return _of_shape(self.propose(*arguments), (current.shape[0],), self, "propose")

        return jax.vmap(propose, in_axes=(0, None, 0, 1, 1, 1), out_axes=1)(
            keys, observation, partition, current, previous, parent
        )

    def log_density(self, observation, partition, new, current, previous, parent) -> jax.Array:
        """Log of the density ``[]`` from which ``propose`` draws ``new`` ``[D]``."""
        _check_defined(self, Proposal, "log_density", "log_density_all")
        columns = (x[:, None] for x in (new, current, previous, parent))
        return self.log_density_all(observation, jnp.asarray(partition)[None], *columns)[0]

    def log_density_all(self, observation, partition, new, current, previous, parent) -> jax.Array:
        """``log_density`` for N particles, ``[N]``: substates ``[D, N]``."""
        _check_defined(self, Proposal, "log_density", "log_density_all")

        def log_density(*arguments):
            return _of_shape(self.log_density(*arguments), (), self, "log_density")

        return jax.vmap(log_density, in_axes=(None, 0, 1, 1, 1, 1))(
            observation, partition, new, current, previous, parent
        )


def _of_shape(values: Any, shape: tuple[int, ...], proposal: Any, name: str) -> Any:
    """Return what a proposal's method returns; refuse another shape than ``shape``."""
    if jnp.shape(values) != shape:
        raise InputError(
            f"{type(proposal).__name__}.{name} returns shape {list(jnp.shape(values))}; return "
            f"{list(shape)}."
        )
    return values


# --- Access to optional methods ------------------------------------------------------------


def observed_apart(tracker: Any) -> tuple[Callable, Callable]:
    """Split a step into the work that depends on the frame alone, and the rest."""
    if hasattr(tracker, "observe") and hasattr(tracker, "step_observed"):
        return tracker.observe, tracker.step_observed
    return (lambda frame: frame), tracker.step


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


def is_coupled(dynamics: Any) -> bool:
    """Whether motion depends on the whole previous state, see ``CoupledDynamics``."""
    return getattr(dynamics, "coupled", False)


def at_frame(tracker: Any, time: Any) -> Any:
    """Return the tracker with the dynamics leading to frame ``time``, counted from 0.

    Returns the tracker unchanged if its dynamics have no ``at_frame``.
    """
    inner = tracker
    while not hasattr(inner, "dynamics") and hasattr(inner, "tracker"):
        inner = inner.tracker
    if not hasattr(getattr(inner, "dynamics", None), "at_frame"):
        return tracker
    return changed_inside(tracker, "dynamics", lambda dynamics: dynamics.at_frame(time))


def first_motion(dynamics: Any) -> Any:
    """Return the dynamics leading to frame 0; unchanged if they have no ``at_frame``."""
    return dynamics.at_frame(0) if hasattr(dynamics, "at_frame") else dynamics


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


def check_uncoupled(dynamics: Any, what: str) -> None:
    """Refuse coupled dynamics if ``what`` splits particles or does not keep whole states.

    Raises:
        InputError: the dynamics are coupled; the message names ``what``.
    """
    if is_coupled(first_motion(dynamics)):
        raise InputError(
            f"{type(dynamics).__name__} moves a partition by all the others, which does not go "
            f"with {what}; use jaxpf.Partitioned with sir, ps or dps, or dynamics of single "
            "partitions."
        )


def has_log_density(dynamics: Any) -> bool:
    """Whether the dynamics define their transition density."""
    dynamics = first_motion(dynamics)
    return hasattr(dynamics, "log_density") or hasattr(dynamics, "log_density_all")


def log_density_all(dynamics, partition, new, current, previous, parent) -> jax.Array:
    """Log-densities ``[N]`` of moves to ``new`` ``[D, N]``, from the batched method if defined."""
    method = method_of(dynamics, DynamicsWithDensity, "log_density_all")
    return method(partition, new, current, previous, parent)


def has_prediction(dynamics: Any) -> bool:
    """Whether the dynamics define a noise-free prediction."""
    dynamics = first_motion(dynamics)
    return hasattr(dynamics, "predict") or hasattr(dynamics, "predict_all")


def predict_all(dynamics, partition, current, previous) -> jax.Array:
    """Substates ``[D, N]`` moved without noise, by the batched method if defined."""
    method = method_of(dynamics, DynamicsWithPrediction, "predict_all")
    return method(partition, current, previous)


def proposal_of(proposal: Any, dynamics: Any, likelihood: Any) -> Any:
    """Give the proposal its model if it defines ``of_model``."""
    return proposal.of_model(dynamics, likelihood) if hasattr(proposal, "of_model") else proposal


def propose_all(proposal, key, observation, partition, current, previous, parent) -> jax.Array:
    """Draw substates ``[D, N]`` from the proposal, with the batched method if defined."""
    method = method_of(proposal, Proposal, "propose_all")
    new = method(key, observation, partition, current, previous, parent)
    return _of_shape(new, current.shape, proposal, "propose_all")


def proposal_log_density_all(
    proposal, observation, partition, new, current, previous, parent
) -> jax.Array:
    """Log-densities ``[N]`` of proposing ``new`` ``[D, N]``, from the batched method if defined."""
    method = method_of(proposal, Proposal, "log_density_all")
    return method(observation, partition, new, current, previous, parent)


def as_seen(likelihood: Any, observation: Any) -> tuple[Any, Any, Any]:
    """Unwrap a likelihood for missing frames: inner likelihood, inner observation, seen mask.

    The mask is bool, ``[]`` or ``[P]``; None means that everything was seen.  Wrappers for missing
    frames define ``as_seen(observation)``.
    """
    if hasattr(likelihood, "as_seen"):
        return likelihood.as_seen(observation)
    return likelihood, observation, None


def log_prob_all(likelihood, observation, partition, substates) -> jax.Array:
    """Log-likelihoods ``[N]`` of substates ``[D, N]``, from the batched method if defined."""
    method = method_of(likelihood, Likelihood, "log_prob_all")
    return method(observation, partition, substates)


def has_log_joint(likelihood: Any) -> bool:
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


def has_log_label(dynamics: Any) -> bool:
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


def expecting(likelihood: Any, estimates: jax.Array) -> Any:
    """Pass the filter's last estimates ``[P, D]`` to the likelihood if it defines ``expecting``.

    Filters that keep an estimate call ``expecting(estimates [P, D]) -> likelihood`` once per frame;
    there is no default.
    """
    return likelihood.expecting(estimates) if hasattr(likelihood, "expecting") else likelihood


def has_log_odds(likelihood: Any) -> bool:
    """Whether a likelihood defines the log odds that an object is at its estimate.

    Filters that report a confidence evaluate ``log_odds(observation, partition [], substate [D])
    -> []`` at the estimates once per frame, or ``log_odds_all`` with ``partition`` ``[N]`` and
    ``substates`` ``[D, N]``.  There is no default.
    """
    return hasattr(likelihood, "log_odds") or hasattr(likelihood, "log_odds_all")


def log_odds_all(likelihood, observation, partition, substates) -> jax.Array:
    """Log odds ``[N]`` of objects being at ``[D, N]``, from the batched method if defined."""
    if hasattr(likelihood, "log_odds_all"):
        return likelihood.log_odds_all(observation, partition, substates)
    return jax.vmap(likelihood.log_odds, in_axes=(None, 0, 1))(observation, partition, substates)


def was_observed(likelihood: Any, observation: Any) -> Any:
    """Whether a frame was observed: ``[]`` or ``[P]`` bool, or True for all frames.

    Only the wrapper for missing frames in ``jaxpf.running`` defines ``was_observed(observation)``.
    Confidence does not change in a frame that was not observed.
    """
    method = getattr(likelihood, "was_observed", None)
    return True if method is None else method(observation)


def has_state_gradient(likelihood: Any) -> bool:
    """Whether ``log_prob`` is more than piecewise constant in the substate."""
    return getattr(likelihood, "state_gradient", True)


def draws_independently(sampler: Any) -> bool:
    """Whether an initial sampler declares that it draws partitions independently."""
    return getattr(sampler, "independent", False)


def of_partition(values: jax.Array, partition: jax.Array) -> jax.Array:
    """Each particle's row of ``values`` ``[P, ...]``: ``[N, ...]``, or ``[1, ...]`` if P is 1.

    With one partition, broadcasting replaces the look-up because its derivative is much faster:
    one sum instead of a sum over runs for each particle and then a sum over particles.
    """
    return values if values.shape[0] == 1 else values[partition]


def method_of(part: Any, base: type, name: str) -> Callable:
    """Return the object's own method, or the base class's default bound to the object."""
    return getattr(part, name, None) or partial(getattr(base, name), part)


def _check_defined(part: Any, base: type, one: str, every: str) -> None:
    """Refuse a class that defines neither of two methods that default to each other."""
    if all(getattr(type(part), name, None) is getattr(base, name) for name in (one, every)):
        raise TypeError(f"{type(part).__name__} must define {one} or {every}")
