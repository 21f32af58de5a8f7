"""What labelled particles cost beside one partition without labels.

Times are of the CPU, on one device: they do not count what else runs on the machine.
"""

import dataclasses
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.boxes.models import box_model
from jaxpf.cli.benchmarks.problems import BOX_SCALE, box_tracker, crowded_frame, keep_estimate
from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.filters.labelled.options import LABELLED, Options
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved

RUNS, PARTICLES = 10, 2100
TITLE = f"Labelled particles: {RUNS} runs, {PARTICLES} particles; CPU time, one device"


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
    model = box_model(likelihood, boxes, BOX_SCALE)
    plain = Options(particles=num_particles)
    fed_back = dataclasses.replace(plain, feedback="estimate", regularise=(0.9, 0.5))
    trackers = {
        "SIR, one box": box_tracker(likelihood, boxes[:1], orderings.sir(1), num_particles),
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
