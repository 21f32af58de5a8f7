"""The interface of trackers, dynamics, likelihoods and proposals: required and optional methods.

All are registered pytrees; ``jaxpf.pytree_dataclass`` registers a class.  Inheritance is optional:
a class only needs the documented methods, about ten lines written for one particle.  The base
classes derive the remaining methods.

===========  ===========================================================
             required
===========  ===========================================================
tracker      ``init``, ``step`` (or ``observe`` with ``step_observed``)
dynamics     ``propagate`` or ``propagate_all``
likelihood   ``observe``, ``log_prob`` or ``log_prob_all``
proposal     ``propose`` or ``propose_all``,
             ``log_density`` or ``log_density_all``
observation  any pytree
sampler      ``__call__(key) -> [P, D]``
===========  ===========================================================

What is optional has no default here, so that a wrapper can pass on what is inside.  It is described
with each class below, and looked up by ``jaxpf.contract.calls`` alone.  An initial sampler that
draws partitions independently may say so by ``independent = True``.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import compiled_alone


class Tracker:
    """Tracks P targets from frame to frame.

    The state is any pytree.  The summary should be a ``jaxpf.Summary``; optional fields that the
    filter does not compute are None.  Evaluation and tuning read ``num_partitions``, P, and
    ``summary.estimate``, ``[P, D]``.

    A state that can be resumed has an attribute ``time``, ``[]`` int32, the number of frames
    processed: 0 from ``init``, one more after every step.  It selects a frame's random numbers,
    so a state without it is refused by ``jaxpf.run(..., state=state)`` and ``jaxpf.forecast``.

    Define ``init`` and ``step_observed``, plus ``observe`` if runs can share work.  If they
    cannot, define ``init`` and ``step``.  Optional are ``num_partitions``, for ``observed`` by
    partition; ``evidence_biases``, see there; ``moments`` and ``states``, for states that are
    pytrees; and ``observe_nearby(frame, state)``, see ``jaxpf.contract.calls.observe_nearby``.
    """

    def init(self, key: jax.Array) -> Any:
        """Return the state just before the first frame."""
        raise TypeError(f"{type(self).__name__} must define init")

    def observe(self, frame: Any) -> Any:
        """Do the work that depends on the frame alone, once per frame for all runs."""
        return frame

    def step_observed(self, key: jax.Array, state: Any, observation: Any) -> tuple[Any, Any]:
        """Return the next state and the frame's summary, given the result of ``observe``."""
        if type(self).step is Tracker.step or type(self).observe is not Tracker.observe:
            raise TypeError(
                f"{type(self).__name__} must define step_observed, or step and no observe"
            )
        return self.step(key, state, observation)  # the observation is the frame itself

    @compiled_alone
    def step(self, key: jax.Array, state: Any, frame: Any) -> tuple[Any, Any]:
        """Return the next state and the frame's summary; compiled once, outside of ``jit`` too.

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
    known camera positions or of uneven frame intervals, for example; past its end, JAX repeats the
    last entry.  Arrays given as ``inputs`` are checked instead: define
    ``with_inputs(inputs, first) -> dynamics``, see ``jaxpf.contract.calls.with_inputs``.

    Particles with a discrete label move it by ``propagate_label(key, label [], substates [P, D])
    -> []``; ``log_label(new [], label [], substates [P, D]) -> []`` is the log-probability of such
    a move.  ``by_partition`` names the fields with a row for each partition.
    """

    def propagate(self, key, partition, current, previous, parent) -> jax.Array:
        """Draw the new substate ``[D]``, x_t.

        ``current`` is x_{t-1} and ``previous`` x_{t-2}; ``parent`` is already moved, zeros for a
        root; ``[D]`` each.
        """
        columns = (x[:, None] for x in (current, previous, parent))
        return self.propagate_all(key, jnp.asarray(partition)[None], *columns)[:, 0]

    def propagate_all(self, key, partition, current, previous, parent) -> jax.Array:
        """``propagate`` for N particles: ``partition`` ``[N]``, substates ``[D, N]``."""
        keys = jax.random.split(key, partition.shape[0])
        move = keys, partition, current, previous, parent
        return _each(self, Dynamics, "propagate", (0, 0, -1, -1, -1), *move)


class CoupledDynamics:
    """Dynamics in which a partition's motion depends on all partitions of the previous frame.

    Examples are pedestrians avoiding each other, or a chaotic system on a grid.  Define
    ``propagate`` or ``propagate_all`` as for ``Dynamics``, with one more argument: ``others``, the
    particle's whole state in the previous frame; ``current`` is the partition's own entry.
    Requires ``jaxpf.Partitioned`` without exchange, whose particles hold whole states, or with
    ``jaxpf.ordering.blocks``, which is biased.
    """

    coupled = True

    def propagate(self, key, partition, current, previous, parent, others) -> jax.Array:
        """Draw the new substate ``[D]``, given ``others`` ``[P, D]``."""
        columns = (x[..., None] for x in (current, previous, parent, others))
        return self.propagate_all(key, jnp.asarray(partition)[None], *columns)[:, 0]

    def propagate_all(self, key, partition, current, previous, parent, others) -> jax.Array:
        """``propagate`` for N particles, ``[D, N]``, given ``others`` ``[P, D, N]``."""
        keys = jax.random.split(key, partition.shape[0])
        move = keys, partition, current, previous, parent, others
        return _each(self, CoupledDynamics, "propagate", (0, 0, -1, -1, -1, -1), *move)


class DynamicsWithDensity(Dynamics):
    """Dynamics with a known density, for ``jaxpf.smooth`` and ``motion_gradient="score"``.

    Define ``log_density`` or ``log_density_all``; each defaults to the other.
    """

    def log_density(self, partition, new, current, previous, parent) -> jax.Array:
        """Log of the density ``[]`` from which ``propagate`` draws ``new`` ``[D]``.

        Leave out dimensions in which all particles hold the same value.  If a direction in which
        particles differ has no noise, such as the position under a constant velocity, there is no
        density; ``jaxpf.smooth(..., method="genealogy")`` needs none.
        """
        columns = (x[:, None] for x in (new, current, previous, parent))
        return self.log_density_all(jnp.asarray(partition)[None], *columns)[0]

    def log_density_all(self, partition, new, current, previous, parent) -> jax.Array:
        """``log_density`` for N particles, ``[N]``: substates ``[D, N]``."""
        move = partition, new, current, previous, parent
        return _each(self, DynamicsWithDensity, "log_density", (0, -1, -1, -1, -1), *move)


class DynamicsWithPrediction(Dynamics):
    """Dynamics that predict a root's substate, for ``Partitioned(joint_weighting=True)``.

    Define ``predict`` or ``predict_all``; each defaults to the other.
    """

    def predict(self, partition, current, previous) -> jax.Array:
        """Return the new substate ``[D]`` without noise."""
        columns = current[:, None], previous[:, None]
        return self.predict_all(jnp.asarray(partition)[None], *columns)[:, 0]

    def predict_all(self, partition, current, previous) -> jax.Array:
        """``predict`` for N particles: ``partition`` ``[N]``, substates ``[D, N]``."""
        move = partition, current, previous
        return _each(self, DynamicsWithPrediction, "predict", (0, -1, -1), *move)


class Likelihood:
    """The observation model.  Define ``log_prob`` or ``log_prob_all``.

    These methods are optional:

    * ``log_joint(observation, substates [P, D], log_probs [P]) -> []``: the log-likelihood of all
      partitions together.  Define it only if the likelihood does not factor over partitions;
      ``log_prob`` is then the weighting function of each stage.
    * ``log_joint_labelled(observation, substates [P, D], log_probs [P], label []) -> []``: the
      same, if it also depends on the particle's label.  Used when particles carry labels.
    * ``log_joint_all`` and ``log_joint_labelled_all``: the same for all particles at once, with
      ``substates [P, D, N]``, ``log_probs [P, N]``, ``label [N]`` and result ``[N]``.
    * ``log_first_stage(observation, substates [P, D]) -> []``: log of the weight by which the
      auxiliary particle filter selects a particle before it moves, such as a rough predictive
      density of the frame.
    * ``sample(key, substates [P, D]) -> frame``: draws an observation, for ``jaxpf.simulate``.
    * ``look_near(observation, estimates [P, D]) -> observation``: what depends on the estimates
      of the previous frame, or is costly to see and is needed near the objects only.
    * ``observe_nearby(frame, estimates [P, D]) -> observation``: ``observe`` of the frame near the
      objects alone, see ``jaxpf.contract.calls.observe_nearby``.
    * ``at_frame`` and ``with_inputs``: for a likelihood that changes with time, as for
      ``Dynamics``.  ``observe`` stays that of the likelihood without a time.
    * ``log_odds(observation, partition [], substate [D]) -> []``, or ``log_odds_all`` with
      ``partition [N]``, ``substates [D, N]`` and result ``[N]``: log odds that an object is at its
      estimate, for filters that report a confidence.
    * ``reaches_border(partition [N], substates [D, N]) -> bool [N]``: which objects may be leaving
      the frame.  The confidence then asks for stronger evidence that an object is back.
    * ``same_place(partition [N], substates [D, N]) -> [N, N]``: from 0 (apart) to 1, which objects
      are in one place.  The confidence then doubts the less likely one.
    * ``as_seen``: of wrappers for missing frames, see ``jaxpf.contract.calls.as_seen``.

    So are these attributes:

    * ``state_gradient``, default true: whether ``log_prob`` has a useful derivative in the
      substate.  A likelihood that reads whole pixels has derivative 0 almost everywhere.
    * ``fixed_observation``, default false: whether the observation depends on the frame alone, not
      on any parameter.
    * ``model_error``, default 0: standard deviations, ``[3]`` or by partition ``[P, 3]``, of the
      truth around the states that explain the frame best: of x and of y in pixels, and of the
      logarithm of the size.  Particles do not show this error; reported intervals and their
      coverage include it.
    * ``handles_nan``, default false: whether the likelihood understands NaN in parts of a frame.
      Otherwise frames with some NaN are refused; a frame that is entirely NaN is missing.
    * ``form``: for likelihoods of a distance (``jaxpf.likelihoods.distance_law``).
    * ``space`` and ``orders_of_labels``: of contours, their shape space and the depth order of each
      label.
    """

    def observe(self, frame: Any) -> Any:
        """Return what ``log_prob`` needs of a frame, computed once for all runs and particles.

        The result is any pytree.  A large node may have a method ``take_frame(index)``, see
        ``frame_of``.
        """
        return frame

    def log_prob(self, observation, partition, substate) -> jax.Array:
        """Log-likelihood ``[]`` of one partition's substate ``[D]``."""
        return self.log_prob_all(observation, jnp.asarray(partition)[None], substate[:, None])[0]

    def log_prob_all(self, observation, partition, substates) -> jax.Array:
        """``log_prob`` for N particles, ``[N]``: ``partition`` ``[N]``, substates ``[D, N]``."""
        seen = observation, partition, substates
        return _each(self, Likelihood, "log_prob", (None, 0, -1), *seen)


class Proposal:
    """Draws substates given the frame, in place of the dynamics.

    Used by ``jaxpf.Partitioned(proposal=...)``; the dynamics need ``log_density``.  Define
    ``propose`` or ``propose_all``, and ``log_density`` or ``log_density_all``.  The proposal
    density must be positive wherever the transition density is.  If the proposal needs the model's
    dynamics or likelihood, also define ``of_model(dynamics, likelihood) -> proposal``, called in
    every frame with those of the frame; there is no default.  With ``jaxpf.state_space``,
    ``dynamics.parameters`` are the model's.  A proposal that changes with time, or that needs
    inputs, defines ``at_frame`` and ``with_inputs`` as ``Dynamics`` do.  ``needs_noise = True``
    says that it moves every coordinate, so that each must have noise.
    """

    def propose(self, key, observation, partition, current, previous, parent) -> jax.Array:
        """Draw the new substate ``[D]``; the past is as for ``Dynamics.propagate``."""
        columns = (x[:, None] for x in (current, previous, parent))
        return self.propose_all(key, observation, jnp.asarray(partition)[None], *columns)[:, 0]

    def propose_all(self, key, observation, partition, current, previous, parent) -> jax.Array:
        """``propose`` for N particles, ``[D, N]``: ``partition`` ``[N]``, substates ``[D, N]``."""
        keys = jax.random.split(key, partition.shape[0])
        move = keys, observation, partition, current, previous, parent
        return _each(self, Proposal, "propose", (0, None, 0, -1, -1, -1), *move)

    def log_density(self, observation, partition, new, current, previous, parent) -> jax.Array:
        """Log of the density ``[]`` from which ``propose`` draws ``new`` ``[D]``."""
        columns = (x[:, None] for x in (new, current, previous, parent))
        return self.log_density_all(observation, jnp.asarray(partition)[None], *columns)[0]

    def log_density_all(self, observation, partition, new, current, previous, parent) -> jax.Array:
        """``log_density`` for N particles, ``[N]``: substates ``[D, N]``."""
        move = observation, partition, new, current, previous, parent
        return _each(self, Proposal, "log_density", (None, 0, -1, -1, -1, -1), *move)


def _each(part: Any, base: type, name: str, axes: tuple[int | None, ...], *arguments: Any) -> Any:
    """Apply a method for one particle, which the class must define, to all on the last axis."""
    if getattr(type(part), name, None) is getattr(base, name):
        raise TypeError(f"{type(part).__name__} must define {name} or {name}_all")
    return jax.vmap(getattr(part, name), axes, -1)(*arguments)
