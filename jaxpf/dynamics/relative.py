"""Motion of boxes, in pixels (smith2004) or relative to the object's size.

Relative motion is heavy-tailed: a fraction of the steps is long.
"""

import math
from typing import ClassVar

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jaxpf.contract import DynamicsWithDensity, DynamicsWithPrediction
from jaxpf.contract.calls import of_partition
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.dynamics.gaussian import AR2


@pytree_dataclass
class PixelMotion(AR2):
    """``AR2`` of boxes (u, v, a).

    Attributes:
        sizes: ``[P, 2]``, width and height at the start, pixels.  The motion does not depend on
            them; code that converts estimates to boxes does.
    """

    by_partition: ClassVar[tuple[str, ...]] = ("scale", "sizes")
    sizes: ArrayLike | None = None


@pytree_dataclass
class RelativeMotion(DynamicsWithDensity, DynamicsWithPrediction):
    """Boxes with heavy-tailed steps relative to their size.

    With s the square root of the box's area and n standard normal::

        position_t = position + momentum (position - position_before) + s steps[k] n
        log a_t    = (1 - pull) log a + steps[2] n

    where k is 1, a long step, with probability ``long``, otherwise 0; u and v share k.

    A substate is (u, v, a) or (u, v, a, b): centre in pixels, scale and aspect relative to the
    start; b moves like a.

    Attributes:
        sizes: ``[P, 2]``, width and height at the start, pixels.
        steps: standard deviations of usual steps, of long steps, and of log a: ``[3]`` or
            ``[P, 3]``.
        momentum: share of the last displacement that is repeated, ``[]`` or ``[P]``.
        long: probability of a long step, ``[]`` or ``[P]``.
        pull: rate per frame at which log a decays towards the start size, ``[]`` or ``[P]``.
    """

    by_partition: ClassVar[tuple[str, ...]] = ("sizes", "steps")
    sizes: ArrayLike
    steps: ArrayLike
    momentum: ArrayLike = 0.3
    long: ArrayLike = 0.4
    pull: ArrayLike = 0.02

    def __post_init__(self):
        for name in ("sizes", "steps"):
            check_number(name, getattr(self, name), least=0)
        for name in ("momentum", "long", "pull"):
            check_number(name, getattr(self, name), least=0, most=1)

    def propagate_all(self, key, partition, current, previous, parent):
        """Move all particles, ``[D, N]``."""
        step_key, choice_key = jax.random.split(key)
        noise = jax.random.normal(step_key, current.shape, current.dtype)
        choice = jax.random.uniform(choice_key, partition.shape, current.dtype)
        usual, far, of_size = self._scales(partition, current)
        step = jnp.where(choice < self._own("long", partition, current), far, usual)
        drift = self._drift(partition, current, previous)
        position = drift[:2] + step * noise[:2]
        return jnp.concatenate([position, jnp.exp(drift[2:] + of_size * noise[2:])])

    def log_density_all(self, partition, new, current, previous, parent):
        """Log-densities of all particles, ``[N]``."""
        usual, far, of_size = self._scales(partition, current)
        long = self._own("long", partition, current)
        drift = self._drift(partition, current, previous)
        away = jnp.sum((new[:2] - drift[:2]) ** 2, axis=0)
        steps = [_log_normal(away, scale, 2) for scale in (usual, far)]
        mixed = jnp.logaddexp(jnp.log1p(-long) + steps[0], jnp.log(long) + steps[1])
        log_size = jnp.log(new[2:])
        sizes = _log_normal((log_size - drift[2:]) ** 2, of_size, 1) - log_size
        return mixed + jnp.sum(jnp.where(of_size > 0, sizes, 0.0), axis=0)

    def predict_all(self, partition, current, previous):
        """Expected substates ``[D, N]``; a and b without the mean of their log-normal noise."""
        drift = self._drift(partition, current, previous)
        return jnp.concatenate([drift[:2], jnp.exp(drift[2:])])

    def _scales(self, partition, current):
        """Standard deviations of usual and long steps, pixels, and of log a, ``[N]`` each."""
        steps = jnp.asarray(self.steps, current.dtype)
        steps = steps[None] if steps.ndim == 1 else of_partition(steps, partition)
        side = jnp.sqrt(jnp.prod(jnp.asarray(self.sizes, current.dtype), axis=1))
        side = of_partition(side, partition) * current[2]
        return side * steps[:, 0], side * steps[:, 1], steps[:, 2]

    def _drift(self, partition, current, previous):
        """Noise-free prediction of a particle: u, v, log a (and log b), ``[D, N]``."""
        momentum = self._own("momentum", partition, current)
        position = current[:2] + momentum * (current[:2] - previous[:2])
        stay = 1 - self._own("pull", partition, current)
        return jnp.concatenate([position, stay * jnp.log(current[2:])])

    def _own(self, name, partition, like):
        """A parameter of each particle's partition, ``[]`` or ``[N]``."""
        value = jnp.asarray(getattr(self, name), like.dtype)
        return of_partition(value, partition) if value.ndim else value


def _log_normal(squared, scale, dimension):
    """Log-densities of isotropic normal distributions, from squared distances; scale 0 adds 0."""
    noisy = scale > 0
    scale = jnp.where(noisy, scale, 1.0)
    density = -0.5 * squared / scale**2 - dimension * (jnp.log(scale) + 0.5 * math.log(2 * math.pi))
    return jnp.where(noisy, density, 0.0)
