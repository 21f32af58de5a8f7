"""A filter of one's own, with a state of its own: one small particle filter for every object."""

from typing import Annotated, Any, Literal

import jax
import jax.numpy as jnp

import jaxpf
from jaxpf.contract import Option, static_field


@jaxpf.pytree_dataclass
class Swarms:
    particles: jax.Array  # [P, M, D]
    previous: jax.Array
    log_weights: jax.Array  # [P, M]


@jaxpf.pytree_dataclass
class Report:
    estimate: jax.Array  # [P, D]
    log_evidence: jax.Array  # []


@jaxpf.pytree_dataclass
class Independent:
    dynamics: Any
    likelihood: Any
    initial: Any  # [P, D]
    num_particles: int = static_field(default=60)

    @property
    def num_partitions(self):
        return self.initial.shape[0]

    def init(self, key):
        start = jnp.repeat(jnp.asarray(self.initial)[:, None], self.num_particles, axis=1)
        return Swarms(start, start, jnp.zeros(start.shape[:2]))

    def observe(self, frame):
        return self.likelihood.observe(frame)

    def step(self, key, state, frame):
        return self.step_observed(key, state, self.observe(frame))

    def step_observed(self, key, state, observation):
        def one(key, part, particles, previous, log_weights):
            chosen = jax.random.categorical(key, log_weights, shape=(self.num_particles,))
            now, before = particles[chosen], previous[chosen]
            keys = jax.random.split(jax.random.fold_in(key, 1), self.num_particles)
            move = jax.vmap(self.dynamics.propagate, in_axes=(0, None, 0, 0, None))
            new = move(keys, part, now, before, jnp.zeros(now.shape[1]))
            weigh = jax.vmap(self.likelihood.log_prob, in_axes=(None, None, 0))
            return new, now, weigh(observation, part, new)

        parts = jnp.arange(self.num_partitions)
        moved = jax.vmap(one)(
            jax.random.split(key, self.num_partitions), parts, *jax.tree.leaves(state)
        )
        state, weights = Swarms(*moved), jax.nn.softmax(moved[2], axis=1)
        evidence = jax.nn.logsumexp(moved[2], axis=1) - jnp.log(self.num_particles)
        return state, Report(jnp.einsum("pm,pmd->pd", weights, moved[0]), jnp.sum(evidence))


def build(
    model,
    *,
    method: Annotated[Literal["swarms"], Option("swarms (a filter for each object)")] = "swarms",
    num_particles: Annotated[int, Option("Number of particles of each object.", least=1)] = 60,
):
    return Independent(model.dynamics, model.likelihood, model.initial, num_particles)


# From here on it is a method of the factories and, in a package, of the command line.
FILTER = jaxpf.filters.Filter(name="swarms", build=build)
jaxpf.filters.register(FILTER)


def independent(scene):
    colour = {"appearance": "colour", "method": "swarms"}
    return jaxpf.boxes.tracker(scene.frames[0], scene.boxes[0], **colour)
