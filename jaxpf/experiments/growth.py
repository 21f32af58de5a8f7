"""How the cost of a filter grows with particles, partitions and runs."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.experiments.speed import interleaved, keep_report, line_tracker

_PARTICLES, _PARTITIONS, _RUNS = 1000, (1, 2, 4, 8, 16), (1, 10, 100, 1000)
#: Sequences are long enough for this many particles, so that starting one costs little.
_ENOUGH = 10**6


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
    """Times of a 1-D model on one device: N grows to ``largest``, then P and R at N = 1000."""
    sizes = [(10**k, 1, 1) for k in range(2, 7) if 10**k <= largest]
    sizes += [(_PARTICLES, p, 1) for p in _PARTITIONS]
    sizes += [(_PARTICLES, 1, r) for r in _RUNS if _PARTICLES * r <= largest]
    for num_particles, num_partitions, num_runs in dict.fromkeys(sizes):
        units = num_particles * num_partitions * num_runs
        num_frames = int(np.clip(_ENOUGH // units, 5, 1000))
        candidate = partial(
            jaxpf.monte_carlo,
            line_tracker(num_particles, num_partitions),
            jax.random.split(jax.random.key(0), num_runs),
            jnp.zeros((num_frames, num_partitions, 1)),
            keep_report,
            min(num_runs, 100),
            jax.local_devices()[:1],
        )
        seconds = interleaved({"it": candidate}, repeats)["it"]
        nanoseconds = float(np.median(seconds)) / (units * num_frames) * 1e9
        yield Growth(num_particles, num_partitions, num_runs, nanoseconds)


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
