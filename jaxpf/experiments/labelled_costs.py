"""What labelled particles cost: beside one partition without labels, and up to 100 targets.

Times are of the CPU, on one device: they do not count what else runs on the machine.
"""

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import jaxpf
from jaxpf.experiments.speed import (
    Row,
    compared,
    crowded_frame,
    interleaved,
    keep_estimate,
    keep_report,
)
from jaxpf.filters.labelled.options import LABELLED, Options
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.models.dynamics import LinearGaussian
from jaxpf.models.likelihoods.gaussian import Gaussian
from jaxpf.models.likelihoods.histogram import histogram
from jaxpf.running import init
from jaxpf.targets.box_models import box_model, box_tracker

RUNS, PARTICLES = 10, 2100
#: Targets of the growth table, each with so many particles.
TARGETS, PER_TARGET = (1, 10, 16, 17, 30, 100), 1000


def rows(
    repeats: int, num_particles: int = PARTICLES, num_runs: int = RUNS, num_frames: int = 8
) -> Iterator[Row]:
    """Seven labelled boxes against one box with as many particles and the same likelihood.

    Both do the same work per particle, but for the labels and where in the frame they look.
    """
    frame, boxes = crowded_frame()
    frames = jnp.stack([jnp.asarray(frame)] * num_frames)
    keys = jax.random.split(jax.random.key(0), num_runs)
    likelihood = histogram(frame, boxes, method="integral")
    scale = (2, 2, 0.001)
    model = box_model(likelihood, boxes, scale)
    plain = Options(particles=num_particles)
    fed_back = dataclasses.replace(plain, feedback="estimate", regularise=(0.9, 0.5))
    trackers = {
        "SIR, one box": box_tracker(
            likelihood, boxes[:1], orderings.sir(1), scale=scale, num_particles=num_particles
        ),
        "labelled, 7 boxes": LABELLED.tracker(model, plain),
        "the same, feedback": LABELLED.tracker(model, fed_back),
    }
    candidates: dict[str, Callable[[], Any]] = {
        name: partial(
            jaxpf.monte_carlo,
            tracker,
            keys,
            frames,
            keep_estimate,
            num_runs,
            jax.local_devices()[:1],
        )
        for name, tracker in trackers.items()
    }
    seconds = interleaved(candidates, repeats, time.process_time)
    units = num_runs * num_particles * num_frames
    for name in candidates:
        goal = "" if name.startswith("SIR") else "<= 1.5"
        yield compared(name, seconds[name], units, seconds["SIR, one box"], "this / SIR", goal)


def line_tracker(num_targets: int, num_particles: int) -> jaxpf.Labelled:
    """Targets on a line, ``x_t = .9 x_{t-1} + n``, observed with unit noise."""
    one = jnp.ones((num_targets, 1, 1))
    return jaxpf.Labelled(
        dynamics=LinearGaussian(transition=0.9 * one, noise=one),
        likelihood=Gaussian(noise=one),
        initial=jnp.zeros((num_targets, 1)),
        num_particles=num_particles,
    )


def growth(
    targets: Sequence[int] = TARGETS, per_target: int = PER_TARGET, repeats: int = 3
) -> Iterator[tuple[int, float]]:
    """Targets, and nanoseconds per particle and frame: level if cost is linear."""
    for num_targets in targets:
        num_particles = num_targets * per_target
        num_frames = int(np.clip(2_000_000 // num_particles, 5, 200))
        candidate = partial(
            jaxpf.monte_carlo,
            line_tracker(num_targets, num_particles),
            jax.random.split(jax.random.key(0), 1),
            jnp.zeros((num_frames, num_targets, 1)),
            keep_report,
            1,
            jax.local_devices()[:1],
        )
        seconds = interleaved({"it": candidate}, repeats, time.process_time)["it"]
        yield num_targets, float(np.median(seconds)) / (num_particles * num_frames) * 1e9


def memory_rows(frames: Sequence[int] = (10, 100, 1000)) -> Iterator[tuple[int, int]]:
    """Bytes that a run of 10 targets over T frames needs beyond input and output."""
    tracker = line_tracker(10, 10_000)

    def track(key, observed):
        def step(state, item):
            state, summary = tracker.step(jax.random.fold_in(key, item[0]), state, item[1])
            return state, summary.log_evidence

        times = jnp.arange(observed.shape[0])
        return lax.scan(step, init(tracker, key), (times, observed))[1]

    for num_frames in frames:
        lowered = jax.jit(track).lower(jax.random.key(0), jnp.zeros((num_frames, 10, 1)))
        analysis: Any = lowered.compile().memory_analysis()
        yield num_frames, int(analysis.temp_size_in_bytes)
