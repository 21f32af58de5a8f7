"""What one colour-histogram likelihood costs; run with ``-m slow``, read the ratios.

Fifty runs of 300 particles, 7 objects of 32 x 42 pixels, frames of 360 x 288 (smith2004's
synthetic test), particles spread by 4 pixels around an object.  Seven stages are run inside
one ``fori_loop``, as a filter does, so that memory is reused and its first touch not timed.
Each benchmark stores nanoseconds per particle and partition in ``extra_info``; nothing is
asserted about time.
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.experiments.speed import OBJECTS, PARTICLES, RUNS, crowded_frame, opencv_loop
from jaxpf.likelihoods.histogram import histogram

pytestmark = pytest.mark.slow

STAGES = OBJECTS
QUERIES = RUNS * PARTICLES * STAGES


def scene():
    """A frame with 7 objects, their boxes, and particles around them."""
    frame, boxes = crowded_frame()
    centres = np.array([(x + 16, y + 21, 1) for x, y, _, _ in boxes], np.float32)
    spread = np.array([4, 4, 0.02], np.float32)
    noise = np.random.default_rng(1).normal(size=(RUNS, PARTICLES, 3)).astype(np.float32) * spread
    return frame, boxes, jnp.array(centres), jnp.array(noise.swapaxes(1, 2))


def stages(likelihood, centres, noise):
    """A function that weighs every particle of every run once per object."""

    def run(observation):
        def stage(j, total):
            partition = jnp.full(PARTICLES, j, jnp.int32)
            at = centres[j][:, None] + noise
            every = jax.vmap(likelihood.log_prob_all, in_axes=(None, None, 0))
            return total + every(observation, partition, at)

        return jax.lax.fori_loop(0, STAGES, stage, jnp.zeros((RUNS, PARTICLES)))

    return jax.jit(run)


def record(benchmark, seconds, queries, **extra):
    benchmark.extra_info.update(nanoseconds_per_query=round(seconds / queries * 1e9, 1), **extra)
    print(benchmark.extra_info)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_query(benchmark, method):
    frame, boxes, centres, noise = scene()
    likelihood = histogram(frame, boxes, method=method)
    observation = jax.jit(likelihood.observe)(frame)
    run = stages(likelihood, centres, noise)
    jax.block_until_ready(run(observation))
    benchmark(lambda: jax.block_until_ready(run(observation)))
    # The OpenCV loop in the same minute: the ratio is what to trust on a shared machine.
    loop = opencv_seconds(frame, boxes[0])
    best = benchmark.stats.stats.min
    record(
        benchmark, best, QUERIES, method=method, bins=likelihood.references.shape[-1],
        opencv_nanoseconds=round(loop * 1e9, 1), times_faster=round(loop * QUERIES / best, 1),
    )  # fmt: skip


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_observe(benchmark, method):
    """Per frame; inside a scan over frames, where the table's memory is reused."""
    frame, boxes, _, _ = scene()
    likelihood = histogram(frame, boxes, method=method)
    frames = jnp.stack([jnp.roll(jnp.array(frame), k, 0) for k in range(4)])

    def step(total, frame):
        observation = likelihood.observe(frame)
        return total + jnp.sum(observation[-1].astype(jnp.int32)), None

    run = jax.jit(lambda frames: jax.lax.scan(step, jnp.int32(0), frames)[0])
    jax.block_until_ready(run(frames))
    benchmark(lambda: jax.block_until_ready(run(frames)))
    best = benchmark.stats.stats.min / len(frames)
    record(
        benchmark, best, RUNS * PARTICLES * OBJECTS, method=method,
        milliseconds_per_frame=round(best * 1e3, 2), bins=likelihood.references.shape[-1],
    )  # fmt: skip


def opencv_seconds(frame, box):
    """Seconds per particle of the loop with calcHist and compareHist, the quickest of three."""
    loop = opencv_loop(frame, box, count=300)
    best = np.inf
    for _ in range(3):
        start = time.perf_counter()
        loop()
        best = min(best, (time.perf_counter() - start) / 300)
    return best
