"""The labelled particle filter as a tracker: ``init`` and ``step``."""

from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import Tracker
from jaxpf.contract.calls import check_factors, look_near
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.options import check_fields
from jaxpf.contract.pytree import compiled_alone, pytree_dataclass
from jaxpf.contract.refusals import Bias, refused
from jaxpf.filters import confidence
from jaxpf.filters.initial import check_rows, draw_initial, initial_rows
from jaxpf.filters.labelled import by_label, kernel, population
from jaxpf.filters.labelled.state import LabelledState, LabelledSummary, Settings
from jaxpf.filters.noiseless import without_noise
from jaxpf.gradients import check_gradients
from jaxpf.lowering.threefry import with_written_out_key
from jaxpf.resampling.schemes import scheme_of


@pytree_dataclass
class Labelled(Settings, Tracker):
    """Labelled particle filter: N particles for L targets, each particle holds one (rowe2005).

    Cost grows with the number of particles only, not with the number of targets.  Targets do not
    interact.  For unbiasedness, see ``jaxpf.filters.labelled.kernel``.

    Attributes:
        dynamics: see ``jaxpf.contract.Dynamics``; a partition is a target, without parents.
        likelihood: see ``jaxpf.contract.Likelihood``; must not define ``log_joint``.
        initial: state just before the first frame: ``[L, D]`` array, or a sampler
            ``key -> [L, D]`` registered as a pytree, from which a particle takes its own target's
            row.  In an open population, an array in which a row of NaN is an empty slot.
        regularise: rates (a_x, a_u) in (0, 1] of position and speed in eq. 6; None does not
            regularise.  It changes the reported estimates and, with feedback, the particles'
            motion.
        resampling: a name in ``jaxpf.resampling.SCHEMES``, or a custom scheme, see there.
        gradient: ``NoGradient()`` or ``StopGradient()`` of ``jaxpf.gradients``.
        num_particles: static, N, for all targets together.
        weights: static: ``"equal_share"`` (eq. 4), ``"plain"``, or ``"corrected"``, which selects
            by eq. 4 and keeps the weights.
        feedback: static: ``"estimate"`` moves particles at the speed of the regularised estimate
            (eq. 5), ``"none"`` at their own speed.
        population: static: in an ``"open"`` population, ``jaxpf.filters.add_target`` and
            ``remove_target`` change the targets between frames; ``initial`` has a row for each that
            there may be at once.  ``"fixed"`` otherwise.
        position: static, indices of the position coordinates.
        speed: static, indices of the coordinates that hold the speed per frame, one for each of
            ``position``; None for dynamics that take it from ``current - previous``.
        motion_gradient: static, one of ``jaxpf.gradients.MOTION_GRADIENTS``.
    """

    def __post_init__(self):
        is_open = self.population != "fixed"
        initial = initial_rows(self.initial, may_be_empty=is_open)
        object.__setattr__(self, "initial", initial)
        for name in ("position", "speed"):
            value = getattr(self, name)
            object.__setattr__(self, name, None if value is None else tuple(value))
        object.__setattr__(self, "resampling", scheme_of(self.resampling))
        _check(self)

    @property
    def evidence_biases(self) -> tuple[Bias, ...]:
        """See ``jaxpf.contract.evidence_biases``: eq. 4 can leave a target without particles."""
        eq4 = self.weights == "equal_share"
        return (
            Bias(eq4, "weights='equal_share' (eq. 4)", "weights='corrected'", False),
            Bias(self.feedback != "none", f"feedback={self.feedback!r}", "feedback='none'", False),
        )

    @compiled_alone
    @with_written_out_key
    def init(self, key: jax.Array) -> LabelledState:
        """Draw the state just before the first frame; each target has 1/L of the weight."""
        if self.population == "open":
            return population.first_state(self)
        num_targets = self.num_partitions
        labels = kernel.first_labels(self.num_particles, num_targets)
        drawn = draw_initial(self.initial, key, self.num_particles)
        values = drawn[:, labels, np.arange(self.num_particles)]
        sizes = np.bincount(labels, minlength=num_targets)
        log_weights = jnp.asarray(-np.log(num_targets * sizes[labels]), values.dtype)
        estimate = by_label.sums(values, jnp.asarray(labels), num_targets)
        estimate = estimate / jnp.asarray(sizes, values.dtype)
        velocity = jnp.zeros((len(self.position), num_targets), values.dtype)
        if self.speed is not None:
            velocity = estimate[np.array(self.speed)]
        return LabelledState(
            lagged=jnp.stack([values, values]),
            labels=jnp.asarray(labels),
            log_weights=log_weights,
            log_mass=jnp.full((num_targets,), -np.log(num_targets), values.dtype),
            estimate=estimate,
            velocity=velocity,
            lost=jnp.zeros((num_targets,), bool),
            weighted=jnp.zeros((), bool),
            presence=confidence.at_start(self.likelihood, num_targets, values.dtype),
            time=jnp.zeros((), jnp.int32),
        )

    def observe(self, frame: Any) -> Any:
        """Do the work that depends on the frame alone; unbatched when runs are vmapped."""
        return self.likelihood.observe(frame)

    @with_written_out_key
    def step_observed(
        self, key: jax.Array, state: LabelledState, observation: Any
    ) -> tuple[LabelledState, LabelledSummary]:
        """Advance one frame: resample, then propagate and weight every particle."""
        chex.assert_shape(state.log_weights, (self.num_particles,))
        chex.assert_shape(state.lagged, (2, None, self.num_particles))
        observation = look_near(self.likelihood, observation, lambda: state.estimate.T)
        # Same keys as Partitioned with one partition: one target gives the same particles.
        begin_key, stages_key = jax.random.split(key)
        resample_key = jax.random.split(begin_key)[0]
        propagate_key = jax.random.split(jax.random.fold_in(stages_key, 0), 4)[0]
        before = state
        state = kernel.select(self, resample_key, state)
        if self.population == "open":
            state = population.with_newborn(self, state)
        state, left = kernel.move(self, propagate_key, state)
        log_factor, largest, num_invalid = kernel.weigh(self, state, left, observation)
        state, log_evidence, of_labels = kernel.share_out(self, state, log_factor, largest)
        after = kernel.report(self, state, log_evidence, of_labels, num_invalid)
        return confidence.reported(self.likelihood, before, *after, observation)


def _check(tracker: Settings) -> None:
    """Refuse settings that cannot work or would be silently wrong."""
    check_fields(tracker)
    gradient, num_targets = tracker.gradient, tracker.num_partitions
    if gradient.blends or not gradient.equalises:
        raise InputError(
            f"gradient {type(gradient).__name__} needs particles that hold all targets; "
            "use NoGradient() or StopGradient() of jaxpf.gradients."
        )
    check_gradients(tracker)
    if tracker.num_particles < num_targets:
        raise InputError(
            Argument("num_particles", tracker.num_particles),
            f" is fewer than the {num_targets} targets that share them; use at least one particle "
            "per target, better some fifty.",
        )
    if tracker.population == "open":
        if callable(tracker.initial):
            raise InputError(
                "population='open' starts from an array [L, D] whose rows of NaN are empty slots, "
                "not from a sampler; give initial as an array."
            )
        if tracker.weights != "equal_share":
            raise InputError(
                f"population='open' gives every new target an equal share, which "
                f"weights={tracker.weights!r} does not; use weights='equal_share'."
            )
    if tracker.feedback != "none" or tracker.regularise is not None or tracker.speed is not None:
        _check_coordinates(tracker)
    check_rows(tracker.dynamics, num_targets)
    check_factors(tracker.dynamics, tracker.likelihood, "labelled particles")
    if tracker.motion_gradient == "score":
        if tracker.feedback != "none":
            raise InputError(
                "motion_gradient='score' needs the density of a move, and feedback='estimate' "
                "changes the move; use feedback='none' or motion_gradient='pathwise'."
            )
        refused(without_noise("motion_gradient='score'", tracker, moved=True))


def _check_coordinates(tracker: Settings) -> None:
    """Position and speed must be different coordinates, one speed for each position."""
    position, speed = tracker.position, tracker.speed
    used = [*position, *(speed or ())]
    dimension = np.inf if callable(tracker.initial) else np.shape(tracker.initial)[1]
    fit = len(set(used)) == len(used) and all(0 <= place < dimension for place in used)
    if not fit or (speed is not None and len(speed) != len(position)):
        raise InputError(
            f"position={list(position)} and speed={speed and list(speed)} must name different "
            "coordinates of a substate, counted from 0, and one speed for each position."
        )
