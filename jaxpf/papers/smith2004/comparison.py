"""Compare orderings on one scene with common seeds."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.boxes import tracker as box_tracker
from jaxpf.contract.state import Summary
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.measures import metrics
from jaxpf.measures.intervals import Interval
from jaxpf.ordering import Ordering
from jaxpf.running.blocks import monte_carlo
from jaxpf.shapes.rectangles import boxes_from_substates


class Result(NamedTuple):
    """Many runs of one ordering on one scene, as NumPy arrays.

    The tracker starts in the first frame of the scene; T counts the frames after it.

    Attributes:
        name: name of the ordering.
        boxes: estimated boxes x, y, w, h, ``[R, T, P, 4]``.
        summary: summary of every run and frame, leading axes ``[R, T]``.
        measures: see ``jaxpf.measures.summarise``.
    """

    name: str
    boxes: np.ndarray
    summary: Summary
    measures: dict[str, Interval]


def scene_tracker(
    scene: Any, ordering: Ordering | None = None, *, num_particles: int | None = None
) -> Partitioned:
    """The paper's tracker of a scene's patches; by default DPS with 300 particles."""
    return box_tracker(
        scene.frames[0],
        scene.boxes[0],
        like="smith2004",
        patches=scene.patches,
        ordering=ordering,
        particles=num_particles,
    )


def compare(
    scene: Any,
    trackers: Mapping[str, Partitioned],
    seeds: Iterable[int],
    batch_size: int | None = None,
) -> Iterator[Result]:
    """Run every tracker with the same seeds; yields each result when it is ready.

    Args:
        scene: see ``scenes.Scene``.
        trackers: name -> tracker; trackers of equal shape share one compiled kernel.
        seeds: one per run.
        batch_size: see ``jaxpf.monte_carlo``.
    """
    keys = jax.vmap(jax.random.key)(np.array(list(seeds)))
    frames, truth = scene.frames[1:], scene.boxes[1:]
    for name, tracker in trackers.items():
        summary = jax.tree.map(
            np.asarray, monte_carlo(tracker, keys, frames, batch_size=batch_size)
        )
        boxes = np.asarray(
            boxes_from_substates(summary.estimate, np.asarray(scene.boxes[0][:, 2:]))
        )
        measures = metrics.summarise(boxes, truth)
        yield Result(name, boxes, summary, jax.tree.map(np.asarray, measures))
