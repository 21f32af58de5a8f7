"""What a tracker, a dynamics and a likelihood are: what each must offer, and what it may.

All are registered pytrees (``jaxpf.pytree_dataclass`` makes one of a class).  A class need
not inherit anything: one with the documented methods will do, about ten lines, written for one
particle.  Who inherits is given what follows from the rest.

============  ===========================================================  =====================
              must offer                                                   may offer
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

Whatever is optional is asked for by the functions at the end, and nowhere else.
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
    """Follows P targets from frame to frame; a filter on a model of them.

    The state is any pytree.  The summary is best a ``jaxpf.Summary``, whose optional fields
    are None where a filter has no such thing.  Evaluation and tuning ask for ``num_partitions``,
    P, and read ``summary.estimate``, ``[P, D]``.

    Define ``init`` and ``step_observed``, and ``observe`` if runs can share work; or, where they
    have nothing to share, ``step`` alone.
    """

    def init(self, key: jax.Array) -> Any:
        """The state just before the first frame."""
        raise TypeError(f"{type(self).__name__} must define init")

    def observe(self, frame: Any) -> Any:
        """Work that depends on the frame alone: done once, however many runs there are."""
        return frame

    def step_observed(self, key: jax.Array, state: Any, observation: Any) -> tuple[Any, Any]:
        """The next state and the frame's summary, of a frame that was observed already."""
        if type(self).observe is not Tracker.observe:
            raise TypeError(f"{type(self).__name__} must define step_observed, as it has observe")
        _check_defined(self, Tracker, "step", "step_observed")
        return self.step(key, state, observation)  # which is the frame itself

    def step(self, key: jax.Array, state: Any, frame: Any) -> tuple[Any, Any]:
        """The next state and the frame's summary.

        Args:
            key: this frame's random key; ``jaxpf.run`` uses ``fold_in(key, t)``, t from 1.
            state: of the frame before.
            frame: whatever ``observe`` takes.
        """
        return self.step_observed(key, state, self.observe(frame))


class Dynamics:
    """How a substate moves.  Define ``propagate``, or ``propagate_all``, which is faster.

    The latter draws noise for all particles at once, where each else has a key of its own.

    A part moves given its own past and its parent, and nothing else.  The exchanges of
    ``jaxpf.ordering.sps`` rest on that: a part is traded together with what hangs from it, and
    whatever else it depended on would stay behind.  What moves by all that was before says so, see
    ``CoupledDynamics``.

    Where the motion changes with time, the method ``at_frame(time []) -> dynamics`` gives the one
    that leads to a frame, counted from 0: for a camera whose path is known, or frames that are not
    evenly spaced, it looks into an array ``[T, ...]`` of its own.  There is no default.
    """

    def propagate(
        self,
        key: jax.Array,
        partition: jax.Array,
        current: jax.Array,
        previous: jax.Array,
        parent: jax.Array,
    ) -> jax.Array:
        """The new substate ``[D]``; ``parent`` ``[D]`` is already moved, zeros for a root."""
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
        """The same for N particles: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, Dynamics, "propagate", "propagate_all")
        keys = jax.random.split(key, partition.shape[0])
        return jax.vmap(self.propagate, in_axes=(0, 0, 1, 1, 1), out_axes=1)(
            keys, partition, current, previous, parent
        )


class CoupledDynamics:
    """Dynamics in which a partition moves by all partitions of the frame before.

    People who keep apart, or a chaotic system on a grid.  Define ``propagate`` or
    ``propagate_all``, as of ``Dynamics``, with one argument more: ``others``, the particle's whole
    state in the frame before, of which ``current`` is the partition's own.  For
    ``jaxpf.Partitioned`` without exchange, whose particles hold whole states.
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
        """The new substate ``[D]``, given ``others`` ``[P, D]``."""
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
        """The same for N particles, ``[D, N]``, given ``others`` ``[P, D, N]``."""
        _check_defined(self, CoupledDynamics, "propagate", "propagate_all")
        keys = jax.random.split(key, partition.shape[0])
        return jax.vmap(self.propagate, in_axes=(0, 0, 1, 1, 1, 2), out_axes=1)(
            keys, partition, current, previous, parent, others
        )


class DynamicsWithDensity(Dynamics):
    """Dynamics whose density is known, for ``jaxpf.smooth`` and ``motion_gradient="score"``.

    Define ``log_density`` or ``log_density_all``, whose default the other is.
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

        A dimension without noise is left out: it is no density, and ``new`` is taken for right.
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
        """The same for N particles, ``[N]``: substates ``[D, N]``."""
        _check_defined(self, DynamicsWithDensity, "log_density", "log_density_all")
        return jax.vmap(self.log_density, in_axes=(0, 1, 1, 1, 1))(
            partition, new, current, previous, parent
        )


class DynamicsWithPrediction(Dynamics):
    """Dynamics that say where a root is expected, for ``Partitioned(look_ahead=True)``.

    Define ``predict`` or ``predict_all``, whose default the other is.
    """

    def predict(self, partition: jax.Array, current: jax.Array, previous: jax.Array) -> jax.Array:
        """The new substate ``[D]`` without noise."""
        _check_defined(self, DynamicsWithPrediction, "predict", "predict_all")
        return self.predict_all(jnp.asarray(partition)[None], current[:, None], previous[:, None])[
            :, 0
        ]

    def predict_all(
        self, partition: jax.Array, current: jax.Array, previous: jax.Array
    ) -> jax.Array:
        """The same for N particles: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, DynamicsWithPrediction, "predict", "predict_all")
        return jax.vmap(self.predict, in_axes=(0, 1, 1), out_axes=1)(partition, current, previous)


class Likelihood:
    """How well a substate explains a frame.  Define ``log_prob`` or ``log_prob_all``.

    A likelihood that does not factor over partitions also defines ``log_joint(observation,
    substates [P, D], log_probs [P]) -> []``, the true log-likelihood of all of them; ``log_prob``
    is then the weighting function of each stage.  There is no default: to have it is to not
    factor.  Where it also depends on the particle's label, it defines ``log_joint_labelled(
    observation, substates [P, D], log_probs [P], label []) -> []``, which is used where particles
    carry labels.  Either may be had for all particles at once, with ``_all`` behind its name:
    ``substates [P, D, N]``, ``log_probs [P, N]``, ``label [N]``, result ``[N]``.  Nor is there a
    default of ``estimated_nanoseconds(frame_shape) -> (float, float)``, the time of ``observe``
    and of one particle's part, by which evaluations plan their work.
    """

    #: Whether ``log_prob`` has a derivative in the substate; one of whole pixels has none but 0.
    state_gradient: Any = True
    #: Whether the observation depends on the frame alone, and on no parameter.
    fixed_observation: Any = False
    #: The form of a likelihood of distances, ``jaxpf.likelihoods.log_density``; None of others.
    form: Any = None

    def observe(self, frame: Any) -> Any:
        """What the likelihood needs of a frame, computed once for all runs and particles.

        Any pytree.  A large node of it may have a method ``take_frame(index)``, see
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
        """The same for N particles, ``[N]``: ``partition`` ``[N]``, ``substates`` ``[D, N]``."""
        _check_defined(self, Likelihood, "log_prob", "log_prob_all")
        return jax.vmap(self.log_prob, in_axes=(None, 0, 1))(observation, partition, substates)


class Proposal:
    """What draws a substate in place of the dynamics, given the frame.

    For ``jaxpf.Partitioned(proposal=...)``, on dynamics with ``log_density``.  Define ``propose``
    or ``propose_all``, and ``log_density`` or ``log_density_all``; ``log_density`` must be positive
    wherever the transition density is.  A proposal that needs the model's own dynamics and
    likelihood also defines ``of_model(dynamics, likelihood) -> proposal``, called in every frame;
    there is no default.
    """

    def propose(self, key, observation, partition, current, previous, parent) -> jax.Array:
        """The new substate ``[D]``; ``parent`` ``[D]`` is already moved, zeros for a root."""
        _check_defined(self, Proposal, "propose", "propose_all")
        columns = (x[:, None] for x in (current, previous, parent))
        return self.propose_all(key, observation, jnp.asarray(partition)[None], *columns)[:, 0]

    def propose_all(self, key, observation, partition, current, previous, parent) -> jax.Array:
        """The same for N particles, ``[D, N]``: ``partition`` ``[N]``, substates ``[D, N]``."""
        _check_defined(self, Proposal, "propose", "propose_all")
        keys = jax.random.split(key, partition.shape[0])
        return jax.vmap(self.propose, in_axes=(0, None, 0, 1, 1, 1), out_axes=1)(
            keys, observation, partition, current, previous, parent
        )

    def log_density(self, observation, partition, new, current, previous, parent) -> jax.Array:
        """Log of the density ``[]`` from which ``propose`` draws ``new`` ``[D]``."""
        _check_defined(self, Proposal, "log_density", "log_density_all")
        columns = (x[:, None] for x in (new, current, previous, parent))
        return self.log_density_all(observation, jnp.asarray(partition)[None], *columns)[0]

    def log_density_all(self, observation, partition, new, current, previous, parent) -> jax.Array:
        """The same for N particles, ``[N]``: substates ``[D, N]``."""
        _check_defined(self, Proposal, "log_density", "log_density_all")
        return jax.vmap(self.log_density, in_axes=(None, 0, 1, 1, 1, 1))(
            observation, partition, new, current, previous, parent
        )


# --- What is optional, asked for -----------------------------------------------------------


def observed_apart(tracker: Any) -> tuple[Callable, Callable]:
    """The part of a step that depends on the frame alone, and the rest."""
    if hasattr(tracker, "observe") and hasattr(tracker, "step_observed"):
        return tracker.observe, tracker.step_observed
    return (lambda frame: frame), tracker.step


def frame_of(observations: Any, place: jax.Array) -> Any:
    """One frame's observation of a stack of them.

    A node of it that has ``take_frame`` finds its frame itself: a large table would be copied.
    """

    def finds_itself(x):
        return hasattr(x, "take_frame")

    def take(x):
        if finds_itself(x):
            return x.take_frame(place)
        return lax.dynamic_index_in_dim(x, place, keepdims=False)

    return jax.tree.map(take, observations, is_leaf=finds_itself)


def propagate_all(dynamics, key, partition, current, previous, parent, *others) -> jax.Array:
    """All particles moved, ``[D, N]``, by the batched method if there is one."""
    base = CoupledDynamics if is_coupled(dynamics) else Dynamics
    method = method_of(dynamics, base, "propagate_all")
    return method(key, partition, current, previous, parent, *others)


def is_coupled(dynamics: Any) -> bool:
    """Whether moves ask for the whole state of the frame before, see ``CoupledDynamics``."""
    return getattr(dynamics, "coupled", False)


def at_frame(tracker: Any, time: Any) -> Any:
    """The tracker that leads to frame ``time``, counted from 0: with the dynamics of that frame.

    Itself, where its dynamics do not change with time (they have no ``at_frame``).
    """
    inner = tracker
    while not hasattr(inner, "dynamics") and hasattr(inner, "tracker"):
        inner = inner.tracker
    if not hasattr(getattr(inner, "dynamics", None), "at_frame"):
        return tracker
    return changed_inside(tracker, "dynamics", lambda dynamics: dynamics.at_frame(time))


def first_motion(dynamics: Any) -> Any:
    """The dynamics that lead to frame 0: themselves, unless they change with time."""
    return dynamics.at_frame(0) if hasattr(dynamics, "at_frame") else dynamics


def changed_inside(tracker: Any, name: str, change: Callable[[Any], Any]) -> Any:
    """A tracker, or the one that it wraps as its ``tracker``, with one field changed.

    Without its constructor, which would check it again, traced as it is.
    """
    changed = copy.copy(tracker)
    if hasattr(tracker, name):
        object.__setattr__(changed, name, change(getattr(tracker, name)))
    else:
        object.__setattr__(changed, "tracker", changed_inside(tracker.tracker, name, change))
    return changed


def check_uncoupled(dynamics: Any, what: str) -> None:
    """Refuse coupled dynamics where a particle holds no whole state, or is to be taken apart.

    Raises:
        InputError: ``what`` does not go with them.
    """
    if is_coupled(first_motion(dynamics)):
        raise InputError(
            f"{type(dynamics).__name__} moves a partition by all the others, which does not go "
            f"with {what}; use jaxpf.Partitioned with sir, ps or dps, or dynamics of single "
            "partitions."
        )


def has_log_density(dynamics: Any) -> bool:
    """Whether the density of a move is known."""
    dynamics = first_motion(dynamics)
    return hasattr(dynamics, "log_density") or hasattr(dynamics, "log_density_all")


def log_density_all(dynamics, partition, new, current, previous, parent) -> jax.Array:
    """Log-densities ``[N]`` of moves to ``new`` ``[D, N]``, by the batched method if any."""
    method = method_of(dynamics, DynamicsWithDensity, "log_density_all")
    return method(partition, new, current, previous, parent)


def has_prediction(dynamics: Any) -> bool:
    """Whether the dynamics say where a substate is expected."""
    dynamics = first_motion(dynamics)
    return hasattr(dynamics, "predict") or hasattr(dynamics, "predict_all")


def predict_all(dynamics, partition, current, previous) -> jax.Array:
    """Substates ``[D, N]`` moved without noise, by the batched method if there is one."""
    method = method_of(dynamics, DynamicsWithPrediction, "predict_all")
    return method(partition, current, previous)


def proposal_of(proposal: Any, dynamics: Any, likelihood: Any) -> Any:
    """A proposal that knows the model, if it asks for it (``of_model``)."""
    return proposal.of_model(dynamics, likelihood) if hasattr(proposal, "of_model") else proposal


def propose_all(proposal, key, observation, partition, current, previous, parent) -> jax.Array:
    """Proposed substates ``[D, N]``, by the batched method if there is one."""
    method = method_of(proposal, Proposal, "propose_all")
    return method(key, observation, partition, current, previous, parent)


def proposal_log_density_all(
    proposal, observation, partition, new, current, previous, parent
) -> jax.Array:
    """Log-densities ``[N]`` of proposing ``new`` ``[D, N]``, by the batched method if any."""
    method = method_of(proposal, Proposal, "log_density_all")
    return method(observation, partition, new, current, previous, parent)


def as_seen(likelihood: Any, observation: Any) -> tuple[Any, Any, Any]:
    """The model's likelihood, its observation, and whether that was seen, ``[]`` or ``[P]``.

    None: all was.  A likelihood that wraps another for missing frames has ``as_seen(observation)``.
    """
    if hasattr(likelihood, "as_seen"):
        return likelihood.as_seen(observation)
    return likelihood, observation, None


def log_prob_all(likelihood, observation, partition, substates) -> jax.Array:
    """Log-likelihoods ``[N]`` of substates ``[D, N]``, by the batched method if there is one."""
    method = method_of(likelihood, Likelihood, "log_prob_all")
    return method(observation, partition, substates)


def has_log_joint(likelihood: Any) -> bool:
    """Whether the likelihood does not factor over partitions."""
    return hasattr(likelihood, "log_joint") or hasattr(likelihood, "log_joint_labelled")


def log_joint_all(likelihood, observation, substates, log_probs, label=None) -> jax.Array:
    """Joint log-likelihoods ``[N]`` of substates ``[D, P, N]``, given ``log_probs`` ``[P, N]``.

    And given labels ``[N]``, if particles carry any and the likelihood asks for them; by the
    batched method if there is one.
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
    """Labels ``[N]`` of the next frame, given substates ``[D, P, N]``; the same if none moves."""
    if not hasattr(dynamics, "propagate_label"):
        return label
    keys = jax.random.split(key, label.shape[0])
    moved = jax.vmap(dynamics.propagate_label, in_axes=(0, 0, 2))(
        keys, label, jnp.swapaxes(substates, 0, 1)
    )
    return moved.astype(label.dtype)


def has_log_label(dynamics: Any) -> bool:
    """Whether the probability of a label's move is known.

    The method ``log_label(new [], label [], substates [P, D]) -> []`` gives the log-probability
    with which ``propagate_label`` draws; ``jaxpf.smooth`` asks for it.  There is no default.
    """
    return hasattr(first_motion(dynamics), "log_label")


def log_label(dynamics, new, label, substates) -> jax.Array:
    """Log-probability ``[]`` of a label's move; without ``propagate_label`` labels stay."""
    if not hasattr(dynamics, "propagate_label"):
        return jnp.where(new == label, 0.0, -jnp.inf)
    return dynamics.log_label(new, label, substates)


def expecting(likelihood: Any, estimates: jax.Array) -> Any:
    """The likelihood, given the filter's last estimates ``[P, D]`` if it asks for them.

    Its method ``expecting(estimates [P, D]) -> likelihood`` is asked once a frame, by filters that
    keep an estimate; there is no default.
    """
    return likelihood.expecting(estimates) if hasattr(likelihood, "expecting") else likelihood


def has_log_odds(likelihood: Any) -> bool:
    """Whether a likelihood knows the odds that an object is where it is reported.

    Its method ``log_odds(observation, partition [], substate [D]) -> []``, or ``log_odds_all`` of
    ``partition`` ``[N]`` and ``substates`` ``[D, N]``, is asked once a frame, of the estimates, by
    filters that report a confidence; there is no default.
    """
    return hasattr(likelihood, "log_odds") or hasattr(likelihood, "log_odds_all")


def log_odds_all(likelihood, observation, partition, substates) -> jax.Array:
    """Log odds ``[N]`` that objects are where ``[D, N]`` says, by the batched method if any."""
    if hasattr(likelihood, "log_odds_all"):
        return likelihood.log_odds_all(observation, partition, substates)
    return jax.vmap(likelihood.log_odds, in_axes=(None, 0, 1))(observation, partition, substates)


def was_observed(likelihood: Any, observation: Any) -> Any:
    """Whether a frame was observed: ``[]`` or ``[P]`` bool, or true of every frame.

    Its method ``was_observed(observation)`` is defined by ``jaxpf.running``'s wrapper for missing
    frames; a confidence does not change in a frame that was not observed.
    """
    method = getattr(likelihood, "was_observed", None)
    return True if method is None else method(observation)


def has_state_gradient(likelihood: Any) -> bool:
    """Whether ``log_prob`` changes with the substate otherwise than in steps."""
    return getattr(likelihood, "state_gradient", True)


def draws_independently(sampler: Any) -> bool:
    """Whether an initial sampler says that it draws partitions independently of one another."""
    return getattr(sampler, "independent", False)


def of_partition(values: jax.Array, partition: jax.Array) -> jax.Array:
    """Each particle's row of ``values`` ``[P, ...]``: ``[N, ...]``, or ``[1, ...]`` if P is 1.

    The derivative of a look-up is a sum over the runs for each particle, and then over the
    particles; with one partition all is one sum, at a fraction of the time.
    """
    return values if values.shape[0] == 1 else values[partition]


def method_of(part: Any, base: type, name: str) -> Callable:
    """A part's own method, or the default of the base class, lent to it."""
    return getattr(part, name, None) or partial(getattr(base, name), part)


def _check_defined(part: Any, base: type, one: str, every: str) -> None:
    """Refuse a class that leaves both of two methods to each other."""
    if all(getattr(type(part), name, None) is getattr(base, name) for name in (one, every)):
        raise TypeError(f"{type(part).__name__} must define {one} or {every}")
