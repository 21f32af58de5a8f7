"""Frames per second of the three systems the paper compares (table 3)."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf import running
from jaxpf.baselines.spot import spot
from jaxpf.experiments.claims import Measured
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.eskil2014 import methods, published

#: Frames over which filters are timed, and SPOT.
_FRAMES, _SPOT_FRAMES = 40, 4

Rates = dict[str, dict[str, float]]


def measure(names: Sequence[str], repeats: int, with_spot: bool = True) -> tuple[Table, Rates]:
    """Table 3: published beside ours, one run at a time, decoding left out, in processor time.

    Args:
        names: of the paper's sequences.
        repeats: timings of each; the fastest counts.
        with_spot: time SPOT, too.
    """
    rows, rates = [], {}
    for name in names:
        sequence = published.SEQUENCES[name]
        scene = scenes.make(sequence.scene, seed=0, num_frames=_FRAMES + 1)
        points = scene.extras["points"][0]
        frames = jnp.asarray(scene.frames[1:])
        rate: dict[str, float] = {}
        trackers = methods.trackers(
            scene.frames[0], points, sequence.scale, (methods.PROPOSED, methods.PFFL)
        )
        for method, tracker in trackers.items():
            rate[method] = _filter_rate(tracker, frames, repeats)
        if with_spot:
            rate[methods.SPOT] = _spot_rate(scene.frames[: _SPOT_FRAMES + 1], points)
        rates[name] = rate
        known = {
            methods.PROPOSED: sequence.proposed,
            methods.PFFL: sequence.pffl,
            methods.SPOT: sequence.spot,
        }
        cells = [
            Cell(known[method], Measured(rate[method], np.nan, np.nan), 2)
            if method in rate
            else Cell(known[method], None, 2)
            for method in known
        ]
        rows.append((f"{name} ({sequence.scene})", cells))
    return Table(
        "frames_per_second",
        "Table 3: frames per second, published | measured",
        ["", methods.PROPOSED, methods.PFFL, methods.SPOT],
        rows,
        f"M = {published.PARTICLES} and {published.PFFL_PARTICLES} particles per point; the "
        "published figures are of MATLAB on a core of 2.2 GHz.  Ours, this machine, by the time "
        f"of its processor: the fastest of {repeats} timings over {_FRAMES} frames, SPOT once over "
        f"{_SPOT_FRAMES}.",
    ), rates


def _filter_rate(tracker: Any, frames: jax.Array, repeats: int) -> float:
    key = jax.random.key(0)

    def once() -> None:
        jax.block_until_ready(running.run(tracker, key, frames))

    once()  # compiles
    return len(frames) / min(_seconds(once) for _ in range(repeats))


def _spot_rate(frames: np.ndarray, points: np.ndarray) -> float:
    def learning() -> None:
        spot(frames[:1], points)

    learning()  # fills OpenCV's caches
    first = _seconds(learning)
    return (len(frames) - 1) / (_seconds(lambda: spot(frames, points)) - first)


def _seconds(function: Callable[[], Any]) -> float:
    """Of the processor: a difference of times by the clock is nothing on a busy machine."""
    began = time.process_time()
    function()
    return time.process_time() - began
