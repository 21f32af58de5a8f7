"""Small models and trackers that many tests share; what a test is about, it changes."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.stats import norm

import jaxpf
from jaxpf import ordering
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian


def walks(number=2, dimension=1):
    """Model of objects that start at zero, walk at random and are seen with unit noise."""
    return {
        "dynamics": RandomWalk(1.0),
        "likelihood": Gaussian(np.tile(np.eye(dimension, dtype=np.float32), (number, 1, 1))),
        "initial": np.zeros((number, dimension), np.float32),
    }


def partitioned(order=None, *, number=None, dimension=1, **changes):
    """A partitioned filter of such walks, in an ordering, or one by one from the last."""
    number = number or (order.num_partitions if order is not None else 2)
    order = ordering.ps(range(number)[::-1]) if order is None else order
    settings = {"ordering": order, "num_particles": 30}
    return jaxpf.Partitioned(**settings | walks(number, dimension) | changes)


@jaxpf.pytree_dataclass
class Adding:
    """The least that is a tracker: it adds frames up, and reports the sum before."""

    start: jax.Array = np.float32(0.0)

    def init(self, key):
        return jnp.asarray(self.start)

    def step(self, key, state, frame):
        return state + frame, state


@jax.jit
def start(tracker):
    """The state before the first frame."""
    return tracker.init(jax.random.key(0))


@jax.jit
def step(tracker, key, state, frame):
    """One frame."""
    return tracker.step(key, state, frame)


#: Parameters of the functions below.
VALUES = {"a": 0.9, "s": 0.5, "noise": 0.7}


def initial(key, p):
    return p["s"] * jax.random.normal(key)


def transition(key, x, p):
    return p["a"] * x + p["s"] * jax.random.normal(key)


def log_density(new, x, p):
    return norm.logpdf(new, p["a"] * x, p["s"])


def log_likelihood(y, x, p):
    return norm.logpdf(y, x, p["noise"])


def space(**changes):
    """A model of plain functions: ``x_t = a x_{t-1} + s n``, seen with noise."""
    model = {
        "initial": initial,
        "transition": transition,
        "log_likelihood": log_likelihood,
        "parameters": VALUES,
        "num_particles": 50,
    }
    return jaxpf.state_space(**model | changes)


def walk(**changes):
    """A random walk from zero, of unit noises."""
    return space(**{"parameters": dict.fromkeys(VALUES, 1.0), "initial": 0.0} | changes)
