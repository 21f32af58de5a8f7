"""How the cost of a filter grows with particles, partitions, runs and targets, on one device."""

import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.cli.benchmarks.problems import labelled_line_tracker, line_seconds, line_tracker

_PARTICLES, _PARTITIONS, _RUNS = 1000, (1, 2, 4, 8, 16), (1, 10, 100, 1000)
#: Sequences are long enough for this many particles, so that starting one costs little.
_ENOUGH = 10**6
#: Targets of labelled particles, each with so many of them.
TARGETS, PER_TARGET = (1, 10, 16, 17, 30, 100), 1000


class Growth(NamedTuple):
    """What one size costs.

    Attributes:
        particles: N.
        partitions: P.
        runs: R.
        nanoseconds: per particle, partition, run and frame: constant if cost is linear.
    """

    particles: int
    partitions: int
    runs: int
    nanoseconds: float


def growth(largest: int = 10**6, repeats: int = 3) -> Iterator[Growth]:
    """Times of a 1-D model: N grows to ``largest``, then P and R at N = 1000."""
    sizes = [(10**k, 1, 1) for k in range(2, 7) if 10**k <= largest]
    sizes += [(_PARTICLES, p, 1) for p in _PARTITIONS]
    sizes += [(_PARTICLES, 1, r) for r in _RUNS if _PARTICLES * r <= largest]
    for num_particles, num_partitions, num_runs in dict.fromkeys(sizes):
        units = num_particles * num_partitions * num_runs
        num_frames = int(np.clip(_ENOUGH // units, 5, 1000))
        tracker = line_tracker(num_particles, num_partitions)
        seconds = line_seconds(tracker, num_partitions, num_frames, repeats, num_runs)
        yield Growth(num_particles, num_partitions, num_runs, 1e9 * seconds / (units * num_frames))


def of_targets(
    targets: Sequence[int] = TARGETS, per_target: int = PER_TARGET, repeats: int = 3
) -> Iterator[tuple[int, float]]:
    """Targets of labelled particles, and nanoseconds per particle and frame."""
    for num_targets in targets:
        num_particles = num_targets * per_target
        num_frames = int(np.clip(2 * _ENOUGH // num_particles, 5, 200))
        tracker = labelled_line_tracker(num_targets, num_particles)
        seconds = line_seconds(tracker, num_targets, num_frames, repeats, clock=time.process_time)
        yield num_targets, 1e9 * seconds / (num_particles * num_frames)


def growth_figure(found: Sequence[Growth]) -> Any:
    """Nanoseconds against N, P and R; a level line is linear growth."""
    from jaxpf.media import plotting

    figure, axes = plotting.new_figure(1, 3, figsize=(11, 3.2))
    for axis, name in zip(axes[0], ("particles", "partitions", "runs"), strict=True):
        others = {"particles": _PARTICLES, "partitions": 1, "runs": 1}
        del others[name]
        sweep = sorted(
            (getattr(g, name), g.nanoseconds)
            for g in found
            if all(getattr(g, other) == value for other, value in others.items())
        )
        axis.plot(*zip(*sweep, strict=True), "o-")
        axis.set(xscale="log", xlabel=name, ylim=(0, None))
        axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("ns per particle, partition,\nrun and frame")
    return figure
