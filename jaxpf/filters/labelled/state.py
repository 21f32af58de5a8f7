"""Settings, state and summary of the labelled filter, which all of its files read."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.contract.state import Presence, Summary
from jaxpf.contract.types import DynamicsLike, LikelihoodLike
from jaxpf.filters import options as of
from jaxpf.filters.initial import count_partitions
from jaxpf.gradients import Gradient, NoGradient


@pytree_dataclass
class Settings:
    """The fields of ``jaxpf.Labelled``, which documents them."""

    dynamics: DynamicsLike
    likelihood: LikelihoodLike
    initial: Any
    regularise: of.MaybeShare = None
    resampling: Any = "systematic"
    gradient: Gradient = NoGradient()
    num_particles: of.NumParticles = static_field(default=300)
    weights: of.Weights = static_field(default="equal_share")
    feedback: of.Feedback = static_field(default="none")
    population: of.Population = static_field(default="fixed")
    position: Sequence[int] = static_field(default=(0, 1))
    speed: Sequence[int] | None = static_field(default=None)
    motion_gradient: of.MotionGradient = static_field(default="pathwise")

    @property
    def num_partitions(self) -> int:
        """Number of targets, L, which are the rows of a summary."""
        return count_partitions(self.initial)


@pytree_dataclass
class LabelledState:
    """A weighted set of N particles, each of which holds one of L targets.

    Attributes:
        lagged: ``[2, D, N]``, substates of the current and the previous frame.
        labels: ``[N]`` int32, the target each particle holds.
        log_weights: ``[N]``, normalised: their exponentials sum to one.
        log_mass: ``[L]``, log-probability of each label in the mixture of all targets, from the
            evidence of past frames; the exponentials sum to one.
        estimate: ``[D, L]``, last reported estimates (rowe2005, eq. 6).
        velocity: ``[E, L]``, estimated speeds per frame, of E position coordinates.
        lost: ``[L]`` bool, last reported.
        weighted: ``[]`` bool, false only for an initial set that has not been weighted.
        alive: ``[L]`` bool, slots of an open population that hold a target; None in a fixed
            population.
        newborn: ``[L]`` bool, targets that get their first particles in the next frame; None in a
            fixed population.
        presence: whether targets are at their estimates; None for likelihoods without
            ``log_odds``, and in an open population.
        time: ``[]`` int32, number of frames processed, see ``jaxpf.contract.Tracker``.
    """

    lagged: jax.Array
    labels: jax.Array
    log_weights: jax.Array
    log_mass: jax.Array
    estimate: jax.Array
    velocity: jax.Array
    lost: jax.Array
    weighted: jax.Array
    alive: Any = None
    newborn: Any = None
    presence: Presence | None = None
    time: jax.Array | None = None

    @property
    def substates(self) -> jax.Array:
        """``[..., N, L, D]``: each particle's substate at its label, NaN elsewhere."""
        values = jnp.moveaxis(self.lagged[..., 0, :, :], -1, -2)[..., :, None, :]
        places = jnp.arange(self.log_mass.shape[-1], dtype=self.labels.dtype)
        holds = self.labels[..., :, None] == places
        return jnp.where(holds[..., None], values, jnp.nan)


@pytree_dataclass
class LabelledSummary(Summary):
    """A ``Summary`` whose partitions are the targets, P = L.

    ``distinct_share`` is the share of particles that hold the target; all of them are distinct.
    ``ess`` is the smallest of ``ess_parts``.

    Attributes:
        ess_parts: ``[L]``, effective sample size of each label's particles; 0 without weight.
        label_log_evidence: ``[L]``, log of the frame's factor in an estimate of each target's own
            ``p(y_1:T)``; ``log_evidence`` is for the mixture ``(1/L) sum_l``.
        alive: ``[L]`` bool, slots of an open population that hold a target.  Estimate and spread
            of an empty slot are NaN; if all slots are empty, ``log_evidence`` is 0.  None in a
            fixed population.
    """

    ess_parts: jax.Array | None = None
    label_log_evidence: jax.Array | None = None
    alive: jax.Array | None = None
