"""Executes an evaluation: divides the missing runs into batches, runs and stores each one."""

import dataclasses
import functools
import math
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.plan import Plan
from jaxpf.evaluation.results import BUILT_IN, Batch, Configuration, Results, batch_name
from jaxpf.evaluation.scene import (
    check_scene,
    object_ids,
    open_scene,
    remember_scene,
    same_scene,
    scene_digest,
    start_frame,
)
from jaxpf.evaluation.settings import (
    double_precision,
    new_settings,
    stored_settings,
    write_settings,
)
from jaxpf.evaluation.trackers import own_tracker, read_boxes_like
from jaxpf.evaluation.worker import Work, imported_batch, run_batch
from jaxpf.files.executors import Pool as Pool, local_pool as local_pool
from jaxpf.files.store import locked
from jaxpf.files.writing import remove_leavings, report_os_errors
from jaxpf.lowering import platform
from jaxpf.running.blocks import WIDE, Blocks, blocks_of
from jaxpf.targets import target_of_scene
from scenes import Scene

#: Likelihoods per batch and core, which an interrupted process can lose: about 15 seconds of
#: colour histograms.
_MOST_QUERIES = 5e7
#: How many times as many in the same time on an accelerator.
_ACCELERATION = 100
#: Particles of a filter that chooses their number itself, to estimate its work.
_PARTICLES = 1000


@dataclasses.dataclass(frozen=True)
class Prepared:
    """An evaluation that is ready to run.

    Attributes:
        plan: the requested plan.
        scene: its opened scene.
        results: what is on disk, with settings, truth and configurations.
        done: bool ``[R]`` per configuration, whether each run is on disk.
        damaged: damaged batch files; their runs count as missing.
        work: missing batches.
        imports: missing imported tracks by index of the configuration, with the seconds that
            computing them took here; None for tracks of a file.
    """

    plan: Plan
    scene: Scene
    results: Results
    done: list[np.ndarray]
    damaged: list[Path]
    work: list[Work]
    imports: dict[int, tuple[Batch, float | None]]

    @property
    def missing_runs(self) -> int:
        """Number of missing runs over all configurations."""
        return sum(work.num_runs for work in self.work) + len(self.imports)


def evaluate(
    plan: Plan,
    folder: str | os.PathLike[str],
    *,
    pool: Pool | None = None,
    progress: Callable[[int], None] = lambda runs: None,
    runs_per_batch: int | None = None,
) -> Results:
    """Run every configuration of a plan and store each finished batch.

    The same call resumes, or adds runs if ``plan.runs`` is larger.  On one machine, the results of
    a seed are identical bit for bit for any batches, pool, and number of workers or devices.
    With another number of runs, blocks may have other widths (``jaxpf.running.blocks.blocks_of``)
    and results can differ by rounding.

    Args:
        plan: what to run.
        folder: new, empty, or of the same evaluation.
        pool: the workers, such as ``local_pool(4)`` or ``Pool(client.get_executor, 8)`` of Dask; by
            default this process.
        progress: called with the number of newly finished runs after each batch.
        runs_per_batch: runs that are stored together, rounded up to whole blocks; by default as
            many as take some seconds, which an interruption can lose.

    Raises:
        InputError: the folder has other settings or another version; the scene cannot be opened or
            an object is absent in its first frame; the disk is full; workers died too often.
    """
    prepared = prepare(plan, folder, pool.workers if pool else 1, runs_per_batch)
    return carry_out(prepared, pool=pool, progress=progress)


def prepare(
    plan: Plan,
    folder: str | os.PathLike[str],
    workers: int = 1,
    runs_per_batch: int | None = None,
) -> Prepared:
    """Determine the missing work without writing; arguments and errors as for ``evaluate``."""
    folder = Path(folder)
    settings = stored_settings(plan, folder)
    scene = open_scene(plan.scene)
    check_scene(scene)
    target = target_of_scene(scene, plan.target)
    start = target.scene_start(scene)
    digest = scene_digest(scene)
    if settings is None:
        settings = new_settings(plan, scene, digest, target, start)
    if settings["scene"]["digest"] != digest:
        raise InputError(
            f"scene {scene.name!r} has other pictures or boxes than when the evaluation in "
            f"'{folder}' was begun; choose another output folder, or restore the scene."
        )
    remember_scene(scene, digest)
    reopen = functools.partial(same_scene, plan.scene, digest)
    results = Results(folder, settings, target.scene_shapes(scene)[1:], start, reopen)
    done, damaged = results.survey()
    work, imports = [], {}
    share = math.ceil(sum(np.sum(~runs) for runs in done) / workers)
    for index, configuration in enumerate(results.configurations):
        if done[index].all():
            continue
        if configuration.is_imported:
            imports[index] = _imported(plan, scene, results, configuration.method)
            continue
        most = runs_per_batch or min(share, _most_runs(configuration, scene, start.num_partitions))
        for first, count, blocks in divide(done[index], most):
            work.append(
                Work(
                    index=index,
                    configuration=configuration,
                    first_run=first,
                    num_runs=count,
                    blocks=blocks,
                    seed=plan.seed,
                    float64=double_precision(),
                    open_scene=reopen,
                    target=target.name,
                    function=plan.trackers.get(configuration.method),
                )
            )
    return Prepared(plan, scene, results, done, damaged, work, imports)


def carry_out(
    prepared: Prepared,
    *,
    pool: Pool | None = None,
    progress: Callable[[int], None] = lambda runs: None,
) -> Results:
    """Run what ``prepare`` found missing; arguments and errors as for ``evaluate``.

    The speeds of tracks that were computed here are stored, too.
    """
    results, store = prepared.results, prepared.results.store
    work = ((batch_name(each.index, each.first_run), each) for each in prepared.work)
    with locked(results.folder, "evaluating"):
        remove_leavings(store.folder)
        for path in prepared.damaged:
            with report_os_errors("replace", path):
                path.unlink(missing_ok=True)
        write_settings(results)
        speeds = results.speeds
        for index, (batch, seconds) in prepared.imports.items():
            results.write(index, batch)
            if seconds is not None:
                speeds[index] = len(results.truth) / max(seconds, 1e-9)
                results.write_speeds(speeds)
            progress(len(batch))
        for _, arrays in store.made(work, run_batch, pool):
            progress(len(arrays["runs"]))
    return results


def _most_runs(configuration: Configuration, scene: Scene, num_partitions: int) -> int:
    """Largest number of runs per batch, so that an interruption loses some seconds of work."""
    unit = WIDE * jax.local_device_count()
    if configuration.kind != BUILT_IN:
        return unit
    particles = configuration.parameters["num_particles"] or _PARTICLES
    queries = (len(scene.frames) - 1) * num_partitions * particles
    faster = _ACCELERATION if platform.on_accelerator() else 1
    return max(1, int(faster * _MOST_QUERIES / (WIDE * queries))) * unit


def divide(done: np.ndarray, largest: int) -> Iterator[tuple[int, int, Blocks]]:
    """Divide the missing runs into batches of whole blocks, nearly equal in size.

    Blocks are counted from the first run of a gap.  A run's block thus has the same width however
    the gap is divided and whichever batches survive an interruption.

    Args:
        done: ``[R]`` bool, whether each run is finished.
        largest: limit on runs per batch; a batch has at least one block.

    Yields:
        First run, number of runs, and blocks to compute.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[True], done, [True]]).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2).tolist():
        blocks = blocks_of(stop - start, len(done))
        if stop - start <= largest:
            yield start, stop - start, blocks
            continue
        for count, width in blocks:
            batches = math.ceil(count / max(1, largest // width))
            each = math.ceil(count / batches)
            end = min(stop, start + count * width)
            for first in range(start, end, each * width):
                yield first, min(each * width, end - first), ((each, width),)
            start = end


def _imported(plan: Plan, scene: Scene, results: Results, name: str) -> tuple[Batch, float | None]:
    """Read or compute another tracker's tracks; also the seconds that computing them took."""
    target = results.target
    shapes, seconds = None, None
    if name in plan.trackers:
        function: Any = plan.trackers[name]
        began = time.perf_counter()
        shapes = own_tracker(name, function, scene)
        seconds = time.perf_counter() - began
        if hasattr(function, "seconds"):  # a baseline caches its boxes, so ask it
            seconds = function.seconds(scene)
    elif target.has_boxes:
        ids = object_ids(scene)
        shapes = read_boxes_like(plan.tracks[name], scene.boxes, ids, start_frame(scene))
    given = "points" if shapes is not None and shapes.shape[-1] == 2 else "boxes"
    if shapes is None or given != ("boxes" if target.has_boxes else target.name):
        raise InputError(
            f"{name!r} gives {given}, but the objects of {scene.name!r} are {target.name}; leave "
            "it out."
        )
    return imported_batch(shapes[1:], plan.seed), seconds
