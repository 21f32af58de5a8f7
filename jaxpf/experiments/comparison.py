"""Several orderings on one scene, with common seeds and honest intervals."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf import metrics
from jaxpf.evaluation import trackers as scene_trackers
from jaxpf.exported import run_exported
from jaxpf.geometry import boxes_from_substates
from jaxpf.intervals import Interval
from jaxpf.ordering import Ordering
from jaxpf.partitioned import Partitioned
from jaxpf.running import RUNS_PER_BATCH, monte_carlo
from jaxpf.state import Summary

#: The tracker of smith2004's synthetic test: noise of u and v in pixels, and of the scale.
SMITH2004_SCALE = (2.0, 2.0, 0.001)
SMITH2004_PARTICLES = 300


class Result(NamedTuple):
    """Many runs of one ordering on one scene, in NumPy arrays.

    The first frame of the scene is where the tracker starts; T counts the frames after it.

    Attributes:
        name: of the ordering.
        boxes: estimated boxes x, y, w, h, ``[R, T, P, 4]``.
        summary: of every run and frame, leading axes ``[R, T]``.
        measures: see ``jaxpf.metrics.summarise``.
    """

    name: str
    boxes: np.ndarray
    summary: Summary
    measures: dict[str, Interval]


def scene_tracker(
    scene: Any,
    ordering: Ordering,
    *,
    sharpness: float = 20.0,
    num_particles: int = SMITH2004_PARTICLES,
    scale: tuple[float, ...] = SMITH2004_SCALE,
    resampling: str = "multinomial",
    num_runs: int = 1,
) -> Partitioned:
    """``jaxpf.evaluation.trackers.scene_tracker`` with smith2004's settings as defaults."""
    return scene_trackers.scene_tracker(
        scene,
        ordering,
        sharpness=sharpness,
        num_particles=num_particles,
        scale=scale,
        resampling=resampling,
        num_runs=num_runs,
    )


def compare(
    scene: Any,
    trackers: Mapping[str, Partitioned],
    seeds: Iterable[int],
    batch_size: int = RUNS_PER_BATCH,
) -> Iterator[Result]:
    """Run every tracker with the same seeds; yields each result as it is done.

    Args:
        scene: see ``scenes.Scene``.
        trackers: name -> tracker; those of one shape share one compiled kernel.
        seeds: one per run.
        batch_size: runs that are vectorised together.
    """
    inputs = (
        np.array(list(seeds), np.int32),
        scene.frames[1:],
        scene.boxes[1:],
        scene_trackers.start_sizes(scene),
    )
    for name, tracker in trackers.items():
        found = run_exported(_measured_runs, tracker, *inputs, batch_size=batch_size)
        found = jax.tree.map(np.asarray, found)
        measures = {key: Interval(*value) for key, value in found["measures"].items()}
        yield Result(name, found["boxes"], Summary(**found["summary"]), measures)


def _measured_runs(tracker, seeds, frames, truth, sizes, batch_size):
    """The runs of one tracker and what comes of them, in plain containers."""
    keys = jax.vmap(jax.random.key)(seeds)
    summary = monte_carlo(tracker, keys, frames, batch_size=batch_size)
    boxes = boxes_from_substates(summary.estimate, sizes)
    measures = metrics.summarise(boxes, truth)
    return {
        "boxes": boxes,
        "summary": {field.name: getattr(summary, field.name) for field in fields(summary)},
        "measures": {name: tuple(interval) for name, interval in measures.items()},
    }
