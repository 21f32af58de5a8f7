"""Gaussian dynamics of substates.

``propagate_all`` draws the noise of all particles at once, several times cheaper than one key
per particle; ``propagate`` is derived from it.
"""

import math
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import DynamicsWithDensity, DynamicsWithPrediction
from jaxpf.contract.calls import of_partition
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import pytree_dataclass, static_field


class _NoisyDrift(DynamicsWithDensity, DynamicsWithPrediction):
    """The substate drifts as a subclass says, plus independent normal noise."""

    by_partition: ClassVar[tuple[str, ...]] = ("scale",)
    scale: ArrayLike

    def propagate_all(self, key, partition, current, previous, parent):
        """Move all particles, ``[D, N]``."""
        noise = jax.random.normal(key, current.shape, current.dtype)
        drift = self._drift(current, previous)
        return drift + _per_particle(self.scale, partition, current) * noise

    def log_density_all(self, partition, new, current, previous, parent):
        """Log-densities of all particles, ``[N]``."""
        residual = new - self._drift(current, previous)
        return log_normal(residual, _per_particle(self.scale, partition, current))

    def predict_all(self, partition, current, previous):
        """Expected substates of all particles, ``[D, N]``."""
        return self._drift(current, previous)

    def _drift(self, current, previous):
        raise NotImplementedError


@pytree_dataclass
class RandomWalk(_NoisyDrift):
    """``x_t = x_{t-1} + scale * n``.

    Attributes:
        scale: standard deviation of the noise per frame, ``[D]`` or ``[P, D]`` or ``[]``,
            in the substate's units.
    """

    scale: ArrayLike

    def __post_init__(self):
        check_number("scale", self.scale, least=0)

    def _drift(self, current, previous):
        return current


@pytree_dataclass
class AR2(_NoisyDrift):
    """Second-order autoregression, ``x_t = x_{t-1} + momentum (x_{t-1} - x_{t-2}) + scale n``.

    Source: smith2004, section 2, with momentum .5 and scale (2, 2, .001) for the centre
    (pixels) and the scale of a box.

    Attributes:
        scale: sigma, standard deviation of the noise, ``[D]`` or ``[P, D]`` or ``[]``.
        momentum: share of the last displacement that is repeated.
    """

    scale: ArrayLike
    momentum: ArrayLike = 0.5

    def __post_init__(self):
        check_number("scale", self.scale, least=0)
        check_number("momentum", self.momentum)

    def _drift(self, current, previous):
        return current + jnp.asarray(self.momentum, current.dtype) * (current - previous)


@pytree_dataclass
class FirstOrder(_NoisyDrift):
    """Constant-velocity model, ``x_t = x_{t-1} + u_{t-1} + n``, with noise on all coordinates.

    Source: rowe2005, eq. 5 without feedback and eq. 7: speed and size are random walks.

    Attributes:
        scale: standard deviation of the noise per frame, ``[D]`` or ``[P, D]`` or ``[]``.
        position: static, indices of the position coordinates.
        speed: static, indices of the speed coordinates, per frame.
    """

    scale: ArrayLike
    position: tuple[int, ...] = static_field(default=(0, 1))
    speed: tuple[int, ...] = static_field(default=(2, 3))

    def __post_init__(self):
        check_number("scale", self.scale, least=0)
        for name in ("position", "speed"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if len(self.position) != len(self.speed):
            raise InputError(
                f"position={self.position} and speed={self.speed} must name the same number of "
                "coordinates."
            )

    def _drift(self, current, previous):
        return current.at[np.array(self.position)].add(current[np.array(self.speed)])


@pytree_dataclass
class LinearGaussian(DynamicsWithDensity, DynamicsWithPrediction):
    """``x_t = A x_{t-1} + B x_{t-2} + C parent_t + b + L n`` for each partition.

    Attributes:
        transition: A, ``[P, D, D]``.
        noise: L, ``[P, D, D]``, a square root of the noise covariance.
        lag: B, ``[P, D, D]``, or None for a first-order model.
        coupling: C, ``[P, D, D]``, multiplies the parent's substate at the current frame;
            None if no partition has a parent.
        offset: b, ``[P, D]``, or None.
    """

    by_partition: ClassVar[tuple[str, ...]] = ("transition", "noise", "lag", "coupling", "offset")
    transition: ArrayLike
    noise: ArrayLike
    lag: ArrayLike | None = None
    coupling: ArrayLike | None = None
    offset: ArrayLike | None = None

    def __post_init__(self):
        shape = np.shape(self.transition)
        for name in self.by_partition:
            if (value := getattr(self, name)) is None:
                continue
            check_number(name, value)
            wanted = shape[:2] if name == "offset" else shape
            if np.shape(value) != wanted:  # JAX would repeat rows
                raise InputError(f"{name} has shape {np.shape(value)}; give {wanted}.")

    def propagate_all(self, key, partition, current, previous, parent):
        """Move all particles, ``[D, N]``."""
        noise = jax.random.normal(key, current.shape, current.dtype)
        moved = _apply(self.transition, partition, current) + _apply(self.noise, partition, noise)
        return self._shifted(moved, partition, current, previous, parent)

    def log_density_all(self, partition, new, current, previous, parent):
        """Log-densities of all particles, ``[N]``; the noise must have full rank."""
        mean = _apply(self.transition, partition, current)
        residual = new - self._shifted(mean, partition, current, previous, parent)
        noise = jnp.asarray(self.noise, current.dtype)
        normal = _apply(jnp.linalg.inv(noise), partition, residual)
        volume = of_partition(jnp.linalg.slogdet(noise)[1], partition)
        return log_normal(normal, jnp.ones_like(normal)) - volume

    def predict_all(self, partition, current, previous):
        """Expected substates of all particles, ``[D, N]``; all must be roots (no parent term)."""
        mean = _apply(self.transition, partition, current)
        return self._shifted(mean, partition, current, previous, jnp.zeros_like(current))

    def _shifted(self, moved, partition, current, previous, parent):
        """Add lag, coupling and offset to ``A x_{t-1}``."""
        if self.lag is not None:
            moved = moved + _apply(self.lag, partition, previous)
        if self.coupling is not None:
            moved = moved + _apply(self.coupling, partition, parent)
        if self.offset is not None:
            moved = moved + of_partition(jnp.asarray(self.offset, current.dtype), partition).T
        return moved


@pytree_dataclass
class IndependentGaussian:
    """Initial sampler: independent normal substates, ``key -> [P, D]``.

    Attributes:
        mean: ``[P, D]``.
        scale: standard deviations, broadcast to ``[P, D]``.
    """

    mean: ArrayLike
    scale: ArrayLike

    #: Partitions are drawn independently, so roots may be exchanged (``sps``).
    independent = True

    def __post_init__(self):
        check_number("mean", self.mean)
        check_number("scale", self.scale, least=0)

    def __call__(self, key):
        """Draw all partitions, ``[P, D]``."""
        mean = jnp.asarray(self.mean)
        return mean + jnp.asarray(self.scale) * jax.random.normal(key, mean.shape, mean.dtype)


def log_normal(residual, scale):
    """Log-densities ``[N]`` of independent normal residuals ``[D, N]``; scale 0 adds 0."""
    noisy = scale > 0
    scale = jnp.where(noisy, scale, 1.0)
    terms = -0.5 * (residual / scale) ** 2 - jnp.log(scale) - 0.5 * math.log(2 * math.pi)
    return jnp.sum(jnp.where(noisy, terms, 0.0), axis=0)


def _per_particle(scale, partition, like):
    """``[]``, ``[D]`` or ``[P, D]`` parameters, broadcast against substates ``[D, N]``."""
    scale = jnp.asarray(scale, like.dtype)
    if scale.ndim == 2:
        return of_partition(scale, partition).T
    return scale[:, None] if scale.ndim == 1 else scale


def _apply(matrices, partition, vectors):
    """Multiply each particle's vector ``[D, N]`` by its partition's matrix ``[P, D, D]``."""
    matrices = jnp.asarray(matrices, vectors.dtype)
    # D is small: an explicit sum over columns fuses, a batched dot does not.
    columns = [
        of_partition(matrices[:, :, k], partition).T * vectors[k] for k in range(vectors.shape[0])
    ]
    return sum(columns[1:], start=columns[0])
