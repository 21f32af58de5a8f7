"""Small trackers whose frames make particles impossible, and their gradients."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf import ordering, pytree_dataclass, tuning
from jaxpf.dynamics import RandomWalk

P, T = 2, 3


@pytree_dataclass
class Fenced:
    """Normal around the frame's first number, impossible beyond its second."""

    noise: jax.Array

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        y, fence = observation[partition]
        value = -0.5 * ((y - substate[0]) / self.noise) ** 2 - jnp.log(self.noise)
        return jnp.where(substate[0] > fence, -jnp.inf, value)


def tracker(order, **settings):
    defaults = {
        "dynamics": RandomWalk(scale=jnp.float32(1.0)),
        "likelihood": Fenced(noise=jnp.float32(0.7)),
        "initial": np.zeros((order.num_partitions, 1), np.float32),
        "num_particles": 12,
    }
    return jaxpf.Partitioned(ordering=order, **(defaults | settings))


def frames(fences, num_partitions=P):
    """``[T, P, 2]``: observations of all partitions, and each frame's fences ``[P]``."""
    made = np.zeros((T, num_partitions, 2), np.float32)
    made[..., 0] = np.random.default_rng(0).normal(size=made.shape[:2])
    made[..., 1] = fences
    return made


METHODS = {
    "sir": ordering.sir(P),
    "ps": ordering.ps([1, 0]),
    "dps": ordering.dps(P),
    "literal": ordering.dps(P, reassembly="literal"),
    "sps": ordering.sps(num_partitions=P),
    "random": ordering.sps(num_partitions=P, swap="random"),
}
FENCES = {
    "possible": np.full((T, P), np.inf),
    "some particles": np.full((T, P), 0.3),
    "all particles": np.where(np.arange(T)[:, None] == 1, -np.inf, [np.inf] * P),
    "one partition": np.where(np.arange(T)[:, None] == 1, [-np.inf, np.inf], [np.inf] * P),
}


@jax.jit
def value_and_gradient(made, keys, seen):
    def mean_of_possible(scale, noise):
        changed = dataclasses.replace(
            made,
            dynamics=dataclasses.replace(made.dynamics, scale=scale),
            likelihood=dataclasses.replace(made.likelihood, noise=noise),
        )
        value = tuning.log_evidence(changed, keys, seen, checkpoint=False)
        return jnp.mean(jnp.where(jnp.isneginf(value), 0.0, value)), value

    one = jax.value_and_grad(mean_of_possible, argnums=(0, 1), has_aux=True)
    (_, value), gradient = one(made.dynamics.scale, made.likelihood.noise)
    return value, jnp.stack(gradient)


KEYS = jax.random.split(jax.random.key(0), 6)
