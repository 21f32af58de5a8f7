"""PS, DPS and SPS on smith2004's sizes, the histogram table included, on all devices."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.cli.benchmarks.histogram import LOOPED, PARTICLES, RUNS, opencv_loop
from jaxpf.cli.benchmarks.problems import OBJECTS, box_tracker, crowded_frame, keep_estimate
from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved

TITLE = "Whole kernel: 50 runs, 300 particles, 7 objects, 360x288"


def rows(repeats: int, num_frames: int = 24) -> Iterator[Row]:
    """Every ordering beside PS, and the usual loop beside DPS."""
    frame, boxes = crowded_frame()
    likelihood = histogram(frame, boxes, method="integral")
    frames = jnp.stack([jnp.asarray(frame)] * num_frames)
    keys = jax.random.split(jax.random.key(0), RUNS)
    chosen = {
        "SIR": orderings.sir(OBJECTS),
        "PS": orderings.ps(range(OBJECTS)),
        "DPS": orderings.dps(OBJECTS),
        "SPS": orderings.sps(num_partitions=OBJECTS),
    }
    devices = jax.local_devices()

    def candidate(ordering: Any, devices: Any = None) -> Callable[[], Any]:
        tracker = box_tracker(likelihood, boxes, ordering, PARTICLES)
        return partial(jaxpf.monte_carlo, tracker, keys, frames, keep_estimate, devices=devices)

    candidates: dict[str, Callable[[], Any]] = {n: candidate(o) for n, o in chosen.items()}
    if len(devices) > 1:
        candidates["one device"] = candidate(chosen["DPS"], devices[:1])
    candidates["opencv"] = opencv_loop(frame, boxes[0])
    seconds = interleaved(candidates, repeats)
    units = RUNS * PARTICLES * OBJECTS * num_frames
    for name in chosen:
        goal = {"SPS": "<= 1.10", "SIR": ""}.get(name, "<= 300 ns")
        yield compared(
            f"whole kernel, {name}", seconds[name], units, seconds["PS"], "this / PS", goal
        )
    if len(devices) > 1:
        name = f"the same on one device of {len(devices)}"
        yield compared(name, seconds["one device"], units, seconds["DPS"], "this / DPS", ">= 1.3")
    # 300 ns were asked for on a machine where OpenCV takes 7100: on any machine, 24 times less.
    dps, loop = seconds["DPS"] / units, seconds["opencv"] / LOOPED
    yield compared("OpenCV, one likelihood alone", loop, 1, dps, "this / DPS", ">= 24")
