"""Memory of runs and gradients over many frames, from the compiler; nothing is executed."""

from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.cli.benchmarks.problems import line_tracker, mean_evidence
from jaxpf.gradients import StopGradient
from jaxpf.running import init

#: Runs and particles of ``of_gradients``, its numbers of frames, and the window of its last column.
RUNS, PARTICLES, FRAMES, WINDOW = 10, 1000, (100, 1000), 32


def of_runs(
    tracker: Any, num_partitions: int, frames: Sequence[int] = (10, 100, 1000)
) -> Iterator[tuple[int, int]]:
    """Bytes that a run of a 1-D model over T frames needs beyond its input and output."""

    def track(key, observed):
        def step(state, item):
            state, summary = tracker.step(jax.random.fold_in(key, item[0]), state, item[1])
            return state, summary.log_evidence

        times = jnp.arange(observed.shape[0])
        return lax.scan(step, init(tracker, key), (times, observed))[1]

    for num_frames in frames:
        observed = jnp.zeros((num_frames, num_partitions, 1))
        yield num_frames, _bytes(jax.jit(track).lower(jax.random.key(0), observed))


def of_gradients(
    num_particles: int = PARTICLES,
    lengths: Sequence[int] = FRAMES,
    ways: Sequence[bool | int] = (False, True, WINDOW),
) -> Iterator[tuple[int, list[int]]]:
    """Number of frames -> bytes of a gradient for each setting of ``checkpoint``.

    The defaults are none, every frame, and windows of ``WINDOW`` frames, for ``RUNS`` runs of a 1-D
    model.
    """
    tracker = line_tracker(num_particles, gradient=StopGradient())
    keys = jax.random.split(jax.random.key(0), RUNS)
    gradient = jax.jit(jax.grad(mean_evidence, allow_int=True), static_argnums=3)
    for num_frames in lengths:
        frames = jnp.zeros((num_frames, 1, 1))
        yield num_frames, [_bytes(gradient.lower(tracker, keys, frames, way)) for way in ways]


def _bytes(lowered: Any) -> int:
    return int(lowered.compile().memory_analysis().temp_size_in_bytes)
