"""Motion of one's own: seen by a camera whose path is known, and of partitions that are coupled."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

import jaxpf


@jaxpf.pytree_dataclass
class KnownCamera:
    """``dynamics`` as a camera sees them that moves the picture by ``shifts[t]`` before frame t."""

    dynamics: Any
    shifts: Any  # [T, D]
    shift: Any = 0.0

    def at_frame(self, time):
        return dataclasses.replace(self, shift=jnp.asarray(self.shifts)[time, :, None])

    def propagate_all(self, key, partition, current, previous, parent):
        moved = self.dynamics.propagate_all(key, partition, current, previous, parent)
        return moved + self.shift

    def log_density_all(self, partition, new, current, previous, parent):
        new = new - self.shift
        return self.dynamics.log_density_all(partition, new, current, previous, parent)


@jaxpf.pytree_dataclass
class Coupled(jaxpf.contract.CoupledDynamics):
    """``x_t = matrix x_{t-1} + n``: every partition pulls at every other."""

    matrix: Any  # [P, P]

    def propagate(self, key, partition, current, previous, parent, others):
        mean = jnp.asarray(self.matrix)[partition] @ others  # others: [P, D]
        return mean + jax.random.normal(key, current.shape, current.dtype)
