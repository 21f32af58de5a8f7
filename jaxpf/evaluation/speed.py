"""How fast one run goes: frames per second of every configuration, on the machine that asks.

Apart from the results, which are the same bits wherever they are computed.
"""

import contextlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.evaluation.results import Results
from jaxpf.files.writing import write_text

NAME = "speed.json"
#: A run is timed for so many frames at most, and for about so many seconds.
_FRAMES, _SECONDS = 60, 3.0


def read_speeds(folder: Path, count: int) -> list[float]:
    """Frames per second by configuration; NaN where they were not measured."""
    kept: Any = []
    with contextlib.suppress(OSError, ValueError, RecursionError):
        kept = json.loads((folder / NAME).read_text(encoding="utf-8"))
    kept = kept if isinstance(kept, list) else []
    known = [float(x) if isinstance(x, int | float) and x > 0 else np.nan for x in kept[:count]]
    return known + [np.nan] * (count - len(known))


def keep_speeds(results: Results, seconds: Mapping[int, float]) -> None:
    """Keep how fast boxes were made, of baselines and of functions that give boxes.

    Args:
        results: of the evaluation.
        seconds: that it took for the whole clip, by the configuration's index.

    Raises:
        InputError: the file cannot be written.
    """
    speeds = read_speeds(results.folder, len(results.configurations))
    for index, took in seconds.items():
        speeds[index] = len(results.truth) / max(took, 1e-9)
    _write(results, speeds)


def measure_speeds(
    results: Results,
    trackers: Mapping[str, Any],
    on_begin: Callable[[str], None] = lambda label: None,
) -> None:
    """Time one run of each method alone, as ``jaxpf track`` goes, and keep it in the folder.

    From a frame in memory to its estimate, compiling left out; the median over frames.  Settings
    that share a compiled kernel share the figure.  What was measured before is not measured again.

    Args:
        results: of the evaluation.
        trackers: a user's own, as in the ``Plan``.
        on_begin: called with the label of what is timed next.

    Raises:
        InputError: a tracker cannot be made, or the file not be written.
    """
    import jax

    from jaxpf.evaluation.trackers import tracker_of
    from jaxpf.evaluation.work.schedule import shape_of

    configurations = results.configurations
    speeds = read_speeds(results.folder, len(configurations))
    known: dict[Any, float] = {}
    for index, one in enumerate(configurations):
        if one.is_imported or np.isfinite(speeds[index]):
            continue
        kind = one.method, shape_of(one, results.target)
        if kind not in known:
            on_begin(one.label)
            scene, function = results.scene(), trackers.get(one.method)
            tracker = tracker_of(scene, results.adapter, one, function)
            frames = scene.frames[1 : 2 + _FRAMES]
            known[kind] = _frames_per_second(tracker, jax.random.key(results.seed), frames)
        speeds[index] = known[kind]
    _write(results, speeds)


def _write(results: Results, speeds: Sequence[float]) -> None:
    known = [round(x, 4) if np.isfinite(x) else None for x in speeds]
    write_text(results.folder / NAME, json.dumps(known))


def _frames_per_second(tracker: Any, key: Any, frames: Sequence[np.ndarray]) -> float:
    """Of a run alone; NaN where there is no second frame to time."""
    from jaxpf.running.streaming import stream

    seconds, clock, until = [], time.perf_counter(), np.inf
    for tracked in stream(tracker, key, frames):
        now = time.perf_counter()
        if tracked.time == 0:  # compiled in it
            until = now + _SECONDS
        else:
            seconds.append(now - clock)
        clock = now
        if now > until:
            break
    return float(1 / np.median(seconds)) if seconds else np.nan
