"""What the gradient of the evidence costs beside its value."""

from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import ordering as orderings
from jaxpf.cli.benchmarks.problems import box_tracker, crowded_frame, line_tracker
from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.gradients import StopGradient
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved
from jaxpf.tuning import objectives

RUNS, PARTICLES, OBJECTS = 10, 1000, 3
#: Asked of value and gradient together, in units of the value.
GOAL = 4
TITLE = f"Gradient of the evidence: {RUNS} runs"


def rows(
    repeats: int, num_particles: int = PARTICLES, num_frames: int = 50, num_runs: int = RUNS
) -> Iterator[Row]:
    """Value and gradient against the value alone, every frame computed again on the way back.

    A 1-D linear-Gaussian model by its paths, and boxes with a histogram likelihood by scores.
    """
    line = jnp.asarray(np.random.default_rng(0).normal(size=(num_frames, 1, 1)), jnp.float32)
    frame, boxes = crowded_frame()
    boxes = boxes[:OBJECTS]
    video = jnp.stack([jnp.asarray(frame)] * max(num_frames // 6, 1))
    boxed = box_tracker(
        histogram(frame, boxes, method="integral"),
        boxes,
        orderings.dps(OBJECTS),
        max(num_particles // 3, OBJECTS),
        gradient=StopGradient(),
        motion_gradient="score",
    )
    models = [
        ("1-D, none", line_tracker(num_particles), line, 1),
        ("1-D, stop_gradient", line_tracker(num_particles, gradient=StopGradient()), line, 1),
        (f"{OBJECTS} boxes, stop_gradient", boxed, video, OBJECTS),
    ]
    keys = jax.random.split(jax.random.key(0), num_runs)
    for name, tracker, frames, num_partitions in models:
        seconds = interleaved(_value_and_gradient(tracker, keys, frames), repeats)
        units = num_runs * tracker.num_particles * num_partitions * len(frames)
        value = seconds["value"]
        yield compared(f"{name}: value", value, units, value, "", "")
        of, goal = "this / value", f"<= {GOAL}"
        yield compared(f"{name}: with gradient", seconds["both"], units, value, of, goal)


def mean_evidence(tracker: Any, keys: jax.Array, frames: Any, checkpoint: bool | int = True):
    """Of independent runs: what is timed and measured."""
    return jnp.mean(objectives.log_evidence(tracker, keys, frames, checkpoint=checkpoint))


def _value_and_gradient(
    tracker: Any, keys: jax.Array, frames: jax.Array
) -> dict[str, Callable[[], Any]]:
    value = jax.jit(mean_evidence)
    both = jax.jit(jax.value_and_grad(mean_evidence, allow_int=True))

    def of_the_motion() -> Any:
        # Derivatives of integers are not arrays that can be waited for.
        found, gradient = both(tracker, keys, frames)
        return found, jax.tree.leaves(gradient.dynamics)[0]

    return {"value": lambda: value(tracker, keys, frames), "both": of_the_motion}
