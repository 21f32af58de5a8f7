"""The generic kernel with one partition against a filter written for the model."""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import jaxpf
from jaxpf.cli.benchmarks.problems import keep_report, line_tracker
from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.measures.timing import interleaved

TITLE = "Generic kernel: 1-D model, 50 runs, 1000 particles"
RUNS = 50


@pytree_dataclass
class _OneParticleDynamics:
    """What a user would write for the 1-D model."""

    def propagate(self, key, partition, current, previous, parent):
        return 0.9 * current + jax.random.normal(key, current.shape, current.dtype)


@pytree_dataclass
class _OneParticleLikelihood:
    """What a user would write for the 1-D model."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[0, 0] - substate[0]) ** 2 - 0.5 * jnp.log(2 * jnp.pi)


def minimal_filter(key: jax.Array, frames: jax.Array, num_particles: int) -> Any:
    """A bootstrap filter for one linear-Gaussian model, and nothing but that."""

    def step(carry, item):
        x, log_weights = carry
        time_, y = item
        resample_key, noise_key = jax.random.split(jax.random.fold_in(key, time_))
        weights = jnp.exp(log_weights - jnp.max(log_weights))
        total = lax.scan(lambda c, w: (c + w, c + w), jnp.zeros(()), weights)[1]
        offset = jax.random.uniform(resample_key)
        ends = jnp.ceil(num_particles * total / total[-1] - offset).astype(jnp.int32)
        counts = jnp.zeros(num_particles + 1, jnp.int32).at[ends].add(1, mode="drop")
        ancestors = lax.scan(
            lambda c, n: (c + n, c + n), jnp.zeros((), jnp.int32), counts[:num_particles]
        )[1]
        x = 0.9 * x[ancestors] + jax.random.normal(noise_key, (num_particles,))
        log_weights = -0.5 * (y - x) ** 2 - 0.5 * jnp.log(2 * jnp.pi)
        largest = jnp.max(log_weights)
        weights = jnp.exp(log_weights - largest)
        sum_ = jnp.sum(weights)
        report = (
            largest + jnp.log(sum_ / num_particles),
            jnp.sum(weights * x) / sum_,
            sum_**2 / jnp.sum(weights**2),
        )
        return (x, log_weights), report

    start = jnp.zeros(num_particles), jnp.zeros(num_particles)
    return lax.scan(step, start, (jnp.arange(frames.shape[0]), frames))[1]


def rows(repeats: int, num_particles: int = 1000, num_frames: int = 50) -> Iterator[Row]:
    """Built-in parts, and those a user would write, beside a minimal filter."""
    frames = jnp.asarray(
        np.random.default_rng(0).normal(size=(num_frames, 1, 1)), dtype=jnp.float32
    )
    keys = jax.random.split(jax.random.key(0), RUNS)
    minimal = jax.jit(jax.vmap(lambda key: minimal_filter(key, frames[:, 0, 0], num_particles)))
    built_in = line_tracker(num_particles)
    own = dataclasses.replace(
        built_in, dynamics=_OneParticleDynamics(), likelihood=_OneParticleLikelihood()
    )
    trackers = {
        "generic kernel, built-in parts": built_in,
        "generic kernel, user's own parts": own,
    }
    candidates: dict[str, Callable[[], Any]] = {"minimal": lambda: minimal(keys)}
    for name, tracker in trackers.items():
        candidates[name] = partial(jaxpf.monte_carlo, tracker, keys, frames, keep_report, RUNS)
    seconds = interleaved(candidates, repeats)
    units = RUNS * num_particles * num_frames
    yield compared("minimal filter, 1-D", seconds["minimal"], units, seconds["minimal"], "", "")
    for name, goal in zip(trackers, ("<= 1.5", "<= 2"), strict=True):
        yield compared(name, seconds[name], units, seconds["minimal"], "this / minimal", goal)
