"""Factored particles with dependent and constrained dynamics.

Source: eskil2014 (Eskil, "Factored particle filtering with dependent and constrained partition
dynamics for tracking deformable objects"), section 3.  Each partition has a few particles;
partitions move together (``drift``) and keep their distances (``shape``).
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import contract
from jaxpf.contract.errors import InputError, choice
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import (
    as_array,
    compiled_alone,
    is_concrete,
    pytree_dataclass,
    static_field,
)
from jaxpf.contract.refusals import Bias, refused
from jaxpf.contract.state import Summary, root_or_zero
from jaxpf.filters import confidence, options as of
from jaxpf.filters.factored import cloud, drift
from jaxpf.filters.factored.cloud import Factored, FactoredState
from jaxpf.filters.noiseless import without_noise
from jaxpf.lowering.threefry import with_written_out_key


@pytree_dataclass
class Eskil(Factored):
    """Factored particles that drift together and keep a shape (eskil2014, section 3.4).

    The first two dimensions of a substate (or its only one) are its position; drift and shape act
    on the position.  In every frame, for all partitions at once:

    1. resample M particles by their weights (the paper's step 7, of the previous frame) and
       simulate their moves;
    2. weight them;
    3. compute velocities v' as their weighted means minus the last estimates;
    4. move each particle again, ``upsampling`` times, and add the drift ``sum_j rho_ij v'_j``;
    5. weight them;
    6. multiply the weights by the shape function around step 5's means;
    7. estimate by the weighted mean (the paper's step 8);
    8. store the estimate's velocity (the paper's step 9).

    The drift depends on the frame.  By default it counts as part of the dynamics.  With ``proper``
    it is a proposal, and weights are multiplied by the dynamics' density over the proposal's.  This
    needs ``log_density`` of the dynamics, and degenerates once drifts exceed twice their noise.

    ``log_evidence`` belongs to an unbiased estimate with ``shape="none"`` and either
    ``drift="none"`` or ``proper=True``; otherwise it is NaN.

    Attributes:
        reference: ``[P, 2]``, positions whose distances define the shape; default
            ``initial``.
        shape_scale: sigma_p, for ``shape="relative"`` a share of each distance, for ``"pixels"`` in
            pixels.
        memory: static, tau, number of frames over which velocities are compared; not published.
        drift: static, ``"clip"``, ``"signed"``, ``"literal"``, ``"ridge"`` or ``"none"``.
        shape: static, ``"relative"``, ``"pixels"`` or ``"none"``.
        proper: static, whether the drift is a proposal, see above.

    The other fields are those of ``Factored``: the dynamics of eskil2014 are a random walk with
    sigma_t 10, 5 and 5 pixels, and its upsampling is not published.
    """

    reference: Any = None
    shape_scale: of.ShapeScale = 0.1
    num_particles: of.NumParticles = static_field(default=10)
    upsampling: of.Upsampling = static_field(default=3)
    memory: of.VelocityMemory = static_field(default=10)
    drift: of.Drift = static_field(default="clip")
    shape: of.Shape = static_field(default="relative")
    proper: bool = static_field(default=False)

    def __post_init__(self):
        super().__post_init__()
        if self.reference is not None:
            check_number("reference", self.reference)
            object.__setattr__(self, "reference", as_array(self.reference, float))
        elif not callable(self.initial):
            object.__setattr__(self, "reference", self.initial[:, :2])
        _check(self)

    @property
    def evidence_biases(self) -> tuple[Bias, ...]:
        """See ``jaxpf.contract.evidence_biases``."""
        drifts = self.drift != "none" and not self.proper
        return (
            Bias(self.shape != "none", f"shape={self.shape!r}", "shape='none'"),
            Bias(drifts, f"drift={self.drift!r}", "drift='none' or proper=True"),
        )

    @compiled_alone
    def init(self, key: jax.Array) -> FactoredState:
        """Draw the state just before the first frame, with equal weights."""
        state = super().init(key)
        place = cloud.means(state.log_weights, state.lagged[0])[:2].T
        return dataclasses.replace(state, history=drift.at_rest(place, self.memory))

    @with_written_out_key
    def step_observed(
        self, key: jax.Array, state: FactoredState, observation: Any
    ) -> tuple[FactoredState, Summary]:
        """Advance by one observed frame; see the class."""
        observation = self.looking_near(state, observation)
        motion = state.history
        sample_key, simulate_key, move_key = jax.random.split(key, 3)
        lagged, log_weights = self.survivors(sample_key, state)

        carried, invalid_before = jnp.zeros_like(motion.place), jnp.zeros((), jnp.int32)
        if self.drift != "none":
            simulated = self.moved(simulate_key, lagged)
            promise, invalid_before = self.weighed(observation, simulated)
            posterior, _ = cloud.multiplied(log_weights, promise)
            seen = cloud.means(posterior, simulated)[:2].T - motion.place
            carried = drift.drift(motion, seen, self.drift)

        lagged, log_weights = self.upsampled(lagged, log_weights)
        diffused = self.moved(move_key, lagged)
        new = diffused.at[:2].add(carried.T[..., None])
        log_prob, invalid = self.weighed(observation, new)
        if self.proper:
            ratio = _log_ratio(self.dynamics, new, diffused, lagged)
            log_prob = jnp.where(jnp.isneginf(log_prob), -jnp.inf, log_prob + ratio)
        posterior, totals = cloud.multiplied(log_weights, log_prob)
        if self.shape != "none":
            centres = cloud.means(posterior, new)[:2]
            places = jnp.asarray(self.reference).T
            reference = _distances(places, places).astype(new.dtype)
            log_shape = _log_shape(new[:2], centres, reference, self.shape_scale, self.shape)
            # May be NaN at zero weight.
            log_shape = jnp.where(jnp.isneginf(posterior), 0.0, log_shape)
            posterior, _ = cloud.multiplied(posterior, log_shape)

        exact = not any(bias.applies for bias in self.evidence_biases)
        after = FactoredState(
            lagged=jnp.stack([new, lagged[0]]),
            log_weights=posterior,
            weighted=jnp.ones((), bool),
            history=motion.after(cloud.means(posterior, new)[:2].T),
        )
        log_evidence = None if exact else jnp.full((), jnp.nan, new.dtype)
        summary = cloud.summarise(after, totals, invalid + invalid_before, log_evidence)
        return confidence.reported(self.likelihood, state, after, summary, observation)


def _log_ratio(dynamics, new, diffused, lagged):
    """Log ratio ``[P, N]`` of the dynamics' density to that of the drifted proposal."""
    dimension, num_partitions, num = new.shape
    partition = jnp.repeat(jnp.arange(num_partitions, dtype=jnp.int32), num)
    current, previous = (x.reshape(dimension, -1) for x in lagged)
    parent = jnp.zeros_like(current)

    def density(values):
        return contract.log_density_all(
            dynamics, partition, values.reshape(dimension, -1), current, previous, parent
        )

    return (density(new) - density(diffused)).reshape(num_partitions, num).astype(new.dtype)


def _check(tracker: Eskil) -> None:
    if tracker.drift != "none" and tracker.num_partitions < 2:
        raise InputError(
            choice("drift", tracker.drift),
            f" needs two partitions or more, and initial has {tracker.num_partitions}; add points "
            "or use ",
            choice("drift", "none"),
            ".",
        )
    if tracker.proper and tracker.drift != "none":  # which moves the places
        refused(without_noise("proper=True", tracker, dimension=2))
    if tracker.shape == "none":
        return
    if tracker.reference is None:
        raise InputError(
            f"shape={tracker.shape!r} needs distances, and initial is a sampler; give reference, "
            "[P, 2]."
        )
    if not is_concrete(tracker.reference):
        return
    points = np.asarray(tracker.reference)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.linalg.norm(points[:, None] - points[None], axis=-1) + np.eye(len(points))
    if not np.isfinite(apart).all():
        raise InputError(
            "the positions of the partitions that define the shape are not finite, or too far "
            "apart for 32 bits; give finite pixels, or use shape='none'."
        )
    if not apart.all():
        first, second = np.argwhere(apart == 0)[0]
        raise InputError(
            f"partitions {first} and {second} start at the same place, {points[first].tolist()}: "
            "a shape needs distances; move one of them, or use shape='none'."
        )


def _distances(first: jax.Array, second: jax.Array) -> jax.Array:
    """Distances ``[P, Q, ...]`` of ``[E, P, ...]`` from ``[E, Q]``; finite gradients at zero."""
    apart = first[:, :, None] - second.reshape(*second.shape, *(1,) * (first.ndim - 2))[:, None]
    return root_or_zero(jnp.sum(apart**2, axis=0))


def _log_shape(places, centres, reference, scale, shape: str) -> jax.Array:
    """Log of the shape function, ``[P, N]`` (eskil2014, eq. 11).

    The paper calls it a proposal function, but uses it as a weight: a product of spring potentials
    between a particle and this frame's estimates of the other partitions.

    Args:
        places: ``[E, P, N]``, positions of the particles.
        centres: ``[E, P]``, estimated positions of the partitions, x_j.
        reference: ``[P, P]``, initial distances of the partitions, d_ij.
        scale: sigma_p, a share of each distance or in pixels.
        shape: ``"relative"``: ``(|x_i - x_j| / d_ij - 1) / sigma_p``; ``"pixels"``, the literal
            rule: ``(|x_i - x_j| - d_ij) / sigma_p``.  With the published sigma_p = .01 the literal
            rule leaves one particle per partition.
    """
    away = _distances(places, centres) - reference[..., None]
    others = 1.0 - jnp.eye(reference.shape[0], dtype=places.dtype)
    if shape == "relative":
        away = away / jnp.where(reference > 0, reference, 1.0)[..., None]
        others = others * (reference > 0)
    strain = away / jnp.asarray(scale, places.dtype)
    return -jnp.sum(strain**2 * others[..., None], axis=1)
