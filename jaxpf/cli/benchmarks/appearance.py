"""What learned appearance costs beside colour histograms: the whole kernel, tables included."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.cli.benchmarks.problems import box_tracker, crowded_frame, keep_estimate, large_frame
from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.likelihoods.discriminative import discriminative
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved

RUNS, PARTICLES = 50, 300
TITLE = f"Learned appearance: whole kernel, {PARTICLES} particles"
_GOAL = "<= 2"


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
        colour = histogram(frame, boxes, method="sampled" if runs == 1 else "integral")
        candidates: dict[str, Callable[[], Any]] = {}
        for name, likelihood in (("colour", colour), ("learned", discriminative(frame, boxes))):
            order = orderings.ps(range(len(boxes)))
            tracker = box_tracker(likelihood, boxes, order, num_particles)
            candidates[name] = partial(
                jaxpf.monte_carlo, tracker, keys, frames, keep_estimate, min(runs, 25)
            )
        seconds = interleaved(candidates, repeats)
        units = runs * num_particles * len(boxes) * num_frames
        usual = seconds["colour"]
        method = colour.method
        yield compared(f"{what}: colour, {method}", usual, units, usual, "", "")
        yield compared(f"{what}: learned", seconds["learned"], units, usual, "this / colour", _GOAL)
