"""One small kernel for many tests: orderings, and frames that break, are data."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from records import everything

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.dynamics import IndependentGaussian

N, P, D, T = 60, 3, 2, 3
CHAIN = (-1, 0, 1)


@pytree_dataclass
class TaggedWalk:
    """Dimension 0 walks at random, to NaN beyond an edge; dimension 1 counts frames on."""

    scale: jax.Array
    edge: jax.Array = np.float32(np.inf)

    def propagate(self, key, partition, current, previous, parent):
        step = self.scale * jax.random.normal(key, (), current.dtype)
        moved = current[0] + 0.5 * (current[0] - previous[0]) + step
        return jnp.stack([jnp.where(moved > self.edge, jnp.nan, moved), current[1] + 1])


@pytree_dataclass
class Breakable:
    """Normal, but beyond an edge the frame's ``beyond`` is added to a log-likelihood."""

    noise: jax.Array

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        y, edge, beyond = observation[partition]
        value = -0.5 * ((y - substate[0]) / self.noise) ** 2
        return value + jnp.where(substate[0] > edge, beyond, 0.0)


@pytree_dataclass
class BreakableJoint(Breakable):
    """The same likelihood, told as one that might not factor."""

    def log_joint(self, observation, substates, log_probs):
        return jnp.sum(log_probs)


def frames(edge=None, beyond=0.0, time=1, partition=None):
    """``[T, P, 3]``; what lies beyond the edge is broken in one frame, in one partition or all."""
    made = np.zeros((T, P, 3), np.float32)
    made[:, :, 0] = np.random.default_rng(0).normal(size=(T, P))
    made[:, :, 1] = np.inf
    if edge is not None:
        where = slice(None) if partition is None else partition
        made[time, where, 1:] = edge, beyond
    return made


def tracker(order, **settings):
    defaults = {
        "dynamics": TaggedWalk(np.float32(1.0)),
        "likelihood": Breakable(np.float32(0.7)),
        "initial": IndependentGaussian(
            mean=np.zeros((P, D), np.float32), scale=np.array([1.0, 5.0], np.float32)
        ),
        "num_particles": N,
        "resampling": "multinomial",
    }
    return jaxpf.Partitioned(ordering=order, **(defaults | settings))


@jax.jit
def _run(made, key, observed):
    return jaxpf.run(made, key, observed, everything)[1]


def track(order, observed=None, seed=0, **settings):
    """States and summaries of a run, leading axis T."""
    observed = frames() if observed is None else observed
    made = tracker(order, **settings)
    return jax.device_get(_run(made, jax.random.key(seed), observed))


METHODS = {
    "sir": lambda: ordering.sir(P),
    "ps": lambda: ordering.ps([2, 0, 1]),
    "dps": lambda: ordering.dps(P),
    "dps-literal": lambda: ordering.dps(P, reassembly="literal"),
    "sps-none": lambda: ordering.sps(num_partitions=P, swap="none"),
    "sps-random": lambda: ordering.sps(num_partitions=P, swap="random"),
    "sps-sorted": lambda: ordering.sps(num_partitions=P, swap="sorted"),
    "sps-combinatorial": lambda: ordering.sps(num_partitions=P),
}
every_method = pytest.mark.parametrize("method", METHODS)


@jax.jit
def start(made, key):
    """The state before the first frame."""
    return made.init(key)


@functools.cache
def tracked(method):
    return track(METHODS[method]())
