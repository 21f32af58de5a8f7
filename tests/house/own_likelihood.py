"""A likelihood of one's own, written for one particle: the colour at the centre."""

from typing import Any

import jax.numpy as jnp

import jaxpf


@jaxpf.pytree_dataclass
class CentreColour:
    colours: Any  # [P, 3], 0 to 1
    width: Any

    def observe(self, frame):
        return frame / 255.0

    def log_prob(self, observation, partition, substate):
        last = jnp.array(observation.shape[1::-1]) - 1
        column, row = jnp.clip(jnp.floor(substate[:2]), 0, last).astype(int)
        apart = (observation[row, column] - self.colours[partition]) / self.width
        return -jnp.sum(apart**2) / 2 - 3 * jnp.log(self.width)


def centre_colour(scene):
    likelihood = CentreColour(jnp.stack([p.mean(axis=(0, 1)) / 255 for p in scene.patches]), 0.2)
    return jaxpf.boxes.tracker(
        None, scene.boxes[0], likelihood=likelihood, method="ps", num_particles=60, motion="pixels"
    )
