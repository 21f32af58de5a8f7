"""Targets that step on the integers 0 to 4, with likelihoods from tables, for exact answers."""

import jax
import jax.numpy as jnp
import numpy as np

PLACES = 5


def one_step():
    """Transition probabilities ``[5, 5]`` of ``StepsInARow``."""
    step = np.zeros((PLACES, PLACES))
    for place in range(PLACES):
        for move in (-1, 0, 1):
            step[place, np.clip(place + move, 0, PLACES - 1)] += 1 / 3
    return step


class StepsInARow:
    """Motion: a step left, none, or right, the ends holding."""

    def propagate(self, key, partition, current, previous, parent):
        return jnp.clip(current + jax.random.randint(key, (1,), -1, 2), 0, PLACES - 1)


class ReadFromTables:
    """Likelihood: a frame is a table of the weighting likelihoods ``[P, PLACES]``, and others."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return observation[0][partition, substate[0].astype(int)]
