"""Frames per second of one run of every configuration, measured on the current machine.

Speeds are stored apart from the results, because only the results are reproducible.
"""

import time
from collections.abc import Callable, Hashable, Sequence

import jax
import numpy as np

from jaxpf import filters
from jaxpf.contract.options import options_of
from jaxpf.contract.types import TrackerLike
from jaxpf.evaluation.engine import tracker_for
from jaxpf.evaluation.plan import Plan
from jaxpf.evaluation.results import BUILT_IN, Configuration, Results
from jaxpf.evaluation.scene import open_scene
from jaxpf.running.runs import stream
from jaxpf.targets.target import Target

#: Timing of a run stops after this many frames or about this many seconds.
_FRAMES, _SECONDS = 60, 3.0


def measure_speeds(
    results: Results,
    plan: Plan,
    on_begin: Callable[[str], None] = lambda label: None,
) -> None:
    """Time a single run of each method, as in ``jaxpf track``, and store the speeds.

    The time of a frame runs from the frame in memory to its estimate, without compilation; the
    speed uses the median over frames.  Settings that share a compiled kernel share one speed.
    Stored speeds are not measured again.

    Args:
        results: of the evaluation.
        plan: of the evaluation.
        on_begin: called with the label of the next configuration before it is timed.
    """
    configurations = results.configurations
    speeds = results.speeds
    measured: dict[Hashable, float] = {}
    for index, configuration in enumerate(configurations):
        if configuration.is_imported or np.isfinite(speeds[index]):
            continue
        kind = configuration.method, _kernel(configuration, results.target)
        if kind not in measured:
            on_begin(configuration.label)
            opened = open_scene(plan.scene, results.settings["scene"]["digest"])
            tracker = tracker_for(plan, opened, results.target, configuration)
            frames = opened.scene.frames[1 : 2 + _FRAMES]
            measured[kind] = _frames_per_second(tracker, jax.random.key(results.seed), frames)
        speeds[index] = measured[kind]
    results.write_speeds(speeds)


def _kernel(configuration: Configuration, target: Target) -> tuple[Hashable, ...]:
    """Values on which the compiled kernel depends; equal ones share a kernel."""
    if configuration.kind != BUILT_IN:
        return (configuration.method,)
    filter_ = filters.filter_of(configuration.variant["method"])
    options = options_of(target.tracker, filter_.build)
    names = [
        name for name, option in options.items() if option.compiles and name not in filter_.varied
    ]
    return (filter_.name, *(configuration.parameters[name] for name in names))


def _frames_per_second(tracker: TrackerLike, key: jax.Array, frames: Sequence[np.ndarray]) -> float:
    """Frames per second of a single run; NaN if there is no second frame to time."""
    seconds, clock, until = [], time.perf_counter(), np.inf
    for tracked in stream(tracker, key, frames):
        now = time.perf_counter()
        if tracked.time == 0:  # includes compilation
            until = now + _SECONDS
        else:
            seconds.append(now - clock)
        clock = now
        if now > until:
            break
    return float(1 / np.median(seconds)) if seconds else np.nan
