"""Table 1: the cost of PS and SPS."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.measures.timing import interleaved
from jaxpf.ordering import named
from jaxpf.papers.checkpoints import part
from jaxpf.papers.gonzales2011.published import FRAMES, TIMED_RUNS
from jaxpf.papers.gonzales2011.scenes import NOISE, SWAPS, learn
from jaxpf.parts.models import parts_model
from jaxpf.running.blocks import WIDE, monte_carlo

METHODS = ("PS", "SPS sorted", "SPS combinatorial")

Times = dict[tuple[int, int], dict[str, np.ndarray]]


def measure_times(
    parts: Sequence[int],
    particles: Sequence[int],
    num_frames: int = 4,
    repeats: int = 30,
    num_runs: int = TIMED_RUNS,
    report: Callable[[str], None] = lambda line: None,
) -> Times:
    """(parts, particles) -> method -> CPU seconds per run of 300 frames, ``[repeats]``.

    The runs are filtered together on one device and share the work on a frame; the methods
    alternate.  Measures the process's CPU time rather than wall-clock time, because other programs
    disturb it less.
    """
    cells = [(p, n) for p in parts for n in particles]
    timed = part(
        f"times_{'_'.join(map(str, parts))}-by-{num_runs}",
        lambda: _timed(cells, num_frames, repeats, num_runs, report),
    )
    return {cell: timed[str(cell)] for cell in cells}


def _timed(
    cells: Sequence[tuple[int, int]],
    num_frames: int,
    repeats: int,
    num_runs: int,
    report: Callable[[str], None],
) -> dict[str, dict[str, np.ndarray]]:
    with ThreadPoolExecutor(len(jax.local_devices())) as pool:
        # Compilation is most of the work and can run in several threads.
        compiled = list(
            pool.map(lambda cell: _compiled(cell[0], cell[1], num_frames, num_runs), cells)
        )
    report(f"  {len(cells)} kernels compiled")
    scale = FRAMES / num_frames / num_runs
    timed = {}
    for cell, candidates in zip(cells, compiled, strict=True):
        seconds = interleaved(candidates, repeats, clock=time.process_time)
        timed[str(cell)] = {method: scale * values for method, values in seconds.items()}
        report(f"  {cell[0]} parts, N = {cell[1]} done")
    return timed


def _compiled(
    num_parts: int, num_particles: int, num_frames: int, num_runs: int
) -> dict[str, Callable[[], Any]]:
    """Method -> function that runs it on a sequence; all methods share one compiled kernel."""
    scene = scenes.make("articulated", 0, num_parts=num_parts, num_frames=num_frames + 1)
    likelihood, parents = learn(scene), scene.extras["parents"]
    frames = jnp.asarray(scene.frames[1:])
    keys = jax.random.split(jax.random.key(0), num_runs)
    position, angle = NOISE["smooth"].absolute
    kernel: Any = None
    candidates: dict[str, Callable[[], Any]] = {}
    for method in METHODS:
        ordering = named("ps", parents)
        if method != "PS":
            ordering = named("sps", parents, swap=SWAPS[method])
        model = parts_model(
            likelihood,
            scene.extras["poses"][0],
            scene.sizes,
            parents,
            dynamics="absolute",
            scale=(position, position, angle),
        )
        tracker = Partitioned(
            **model._asdict(),
            ordering=ordering,
            num_particles=num_particles,
            resampling="multinomial",
        )
        if kernel is None:
            kernel = jax.jit(_runs).lower(tracker, keys, frames).compile()
        candidates[method] = partial(kernel, tracker, keys, frames)
    return candidates


def _runs(tracker: Any, keys: Any, frames: Any) -> Any:
    batch_size = min(len(keys), WIDE)
    return monte_carlo(
        tracker, keys, frames, _keep_estimate, batch_size, devices=jax.local_devices()[:1]
    )


def _keep_estimate(state: Any, summary: Any) -> Any:
    return summary.estimate, summary.log_evidence
