"""Figures 9 and 10: two targets of one dimension each, sampled together and one after another."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.dynamics import RandomWalk
from jaxpf.models.likelihoods import Gaussian
from jaxpf.running.blocks import monte_carlo

#: The posterior is this much narrower than the spread of the dynamics.
_NARROWER = 8.0
PARTICLES, _RUNS = 150, 40
TARGET = (1.2, -0.8)


def particle_sets(seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Method -> substates ``[R, N, 2]`` and weights ``[R, N]`` after one frame."""
    noise = jnp.full((2, 1, 1), 1 / _NARROWER)
    frames = jnp.asarray(TARGET).reshape(1, 2, 1)
    found = {}
    for name, ordering in (("SIR", orderings.sir(2)), ("PS", orderings.ps([0, 1]))):
        tracker = Partitioned(
            dynamics=RandomWalk(scale=1.0),
            likelihood=Gaussian(noise),
            ordering=ordering,
            initial=jnp.zeros((2, 1)),
            num_particles=PARTICLES,
        )
        keys = jax.random.split(jax.random.key(seed), _RUNS)
        substates, log_weights = monte_carlo(tracker, keys, frames, _keep, batch_size=_RUNS)
        weights = np.exp(np.asarray(log_weights)[:, 0])
        found[name] = np.asarray(substates)[:, 0, :, :, 0], weights
    return found


def _keep(state: Any, summary: Any) -> Any:
    return state.substates, state.log_weights
