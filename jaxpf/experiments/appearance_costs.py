"""What learned appearance costs beside colour histograms: the whole kernel, tables included."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.experiments.speed import Row, compared, crowded_frame, interleaved, keep_estimate
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.models.likelihoods.discriminative import discriminative
from jaxpf.models.likelihoods.histogram import histogram
from jaxpf.targets.boxes import box_tracker

RUNS, PARTICLES = 50, 300
_GOAL = "<= 2"


def large_frame(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Noise of 640 x 480 with five objects of 60 x 120 pixels, and their boxes ``[P, 4]``."""
    rng = np.random.default_rng(seed)
    frame = rng.integers(0, 256, (480, 640, 3), dtype=np.uint8)
    boxes = np.array([(40 + 110 * i, 60 + 50 * i, 60, 120) for i in range(5)])
    for x, y, w, h in boxes:
        colours = rng.integers(0, 256, (12, 3))
        frame[y : y + h, x : x + w] = colours[rng.integers(0, 12, (h, w))]
    return frame, boxes.astype(float)


def rows(
    repeats: int, num_runs: int = RUNS, num_particles: int = PARTICLES, num_frames: int = 12
) -> Iterator[Row]:
    """Many runs, as an evaluation has them, and one run on larger frames, as a video has it."""
    for what, (frame, boxes), runs in (
        (f"{num_runs} runs, 7 objects, 360x288", crowded_frame(), num_runs),
        ("1 run, 5 objects, 640x480", large_frame(), 1),
    ):
        frames = jnp.stack([jnp.asarray(frame)] * num_frames)
        keys = jax.random.split(jax.random.key(0), runs)
        colour = histogram(frame, boxes, num_particles=num_particles, num_runs=runs)
        candidates: dict[str, Callable[[], Any]] = {}
        for name, likelihood in (("colour", colour), ("learned", discriminative(frame, boxes))):
            tracker = box_tracker(
                likelihood,
                boxes,
                orderings.ps(range(len(boxes))),
                scale=(2, 2, 0.001),
                num_particles=num_particles,
            )
            candidates[name] = partial(
                jaxpf.monte_carlo, tracker, keys, frames, keep_estimate, min(runs, 25)
            )
        seconds = interleaved(candidates, repeats)
        units = runs * num_particles * len(boxes) * num_frames
        usual = seconds["colour"]
        method = colour.method
        yield compared(f"{what}: colour, {method}", usual, units, usual, "", "")
        yield compared(f"{what}: learned", seconds["learned"], units, usual, "this / colour", _GOAL)
