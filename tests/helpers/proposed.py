"""A proposal that sees nothing and is wrong, and what a linearised one needs to know."""

import jax
import jax.numpy as jnp

from jaxpf import pytree_dataclass
from jaxpf.contract import Proposal


@pytree_dataclass
class Bad(Proposal):
    """Away from the truth: to the right of the last place, and wider than the dynamics."""

    shift: float = 0.7
    scale: float = 1.4

    def propose(self, key, observation, partition, current, previous, parent):
        return current + self.shift + self.scale * jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        normal = (new[0] - current[0] - self.shift) / self.scale
        return -0.5 * normal**2 - jnp.log(self.scale * jnp.sqrt(2 * jnp.pi))


def residual(observation, partition, substate):
    """Of observations with unit noise."""
    return jnp.atleast_1d(observation[partition]) - substate
