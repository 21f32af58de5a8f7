"""Executes an evaluation: divides the missing runs into batches, runs and stores each one.

Batches are run in this process or in others, which open the scene themselves.
"""

import dataclasses
import functools
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.calls import model_error
from jaxpf.contract.errors import InputError
from jaxpf.contract.state import Summary
from jaxpf.evaluation.plan import Plan, complete
from jaxpf.evaluation.results import BUILT_IN, OWN, Batch, Configuration, Results, batch_name
from jaxpf.evaluation.scene import Opened, check_scene, object_ids, open_scene, start_frame
from jaxpf.evaluation.settings import new_settings, resumed, stored_settings
from jaxpf.evaluation.trackers import read_boxes_like, tracker_of
from jaxpf.files.executors import Pool as Pool, local_pool as local_pool
from jaxpf.files.store import locked
from jaxpf.files.writing import remove_leavings, report_os_errors
from jaxpf.lowering import platform
from jaxpf.running.blocks import WIDE, Blocks, blocks_of, run_blocks
from jaxpf.targets.building import shapes_of
from jaxpf.targets.registry import find_target, target_of_scene
from jaxpf.targets.target import Target
from scenes import Scene

#: Likelihoods per batch and core, which an interrupted process can lose: about 15 seconds of
#: colour histograms.
_MOST_QUERIES = 5e7
#: How many times as many in the same time on an accelerator.
_ACCELERATION = 100
#: Particles of a filter that chooses their number itself, to estimate its work.
_PARTICLES = 1000


class Work(NamedTuple):
    """A batch to run: a configuration, R runs from the first on, and the blocks they make."""

    configuration: Configuration
    first_run: int
    num_runs: int
    blocks: Blocks


@dataclasses.dataclass(frozen=True)
class Prepared:
    """An evaluation that is ready to run.

    Attributes:
        plan: the requested plan.
        results: what is on disk, with settings, truth and configurations.
        done: bool ``[R]`` per configuration, whether each run is on disk.
        damaged: damaged batch files; their runs count as missing.
        work: missing batches by name.
        imports: missing imported tracks by index of the configuration, with the seconds that
            computing them took here; None for tracks of a file, and for those that never move.
    """

    plan: Plan
    results: Results
    done: list[np.ndarray]
    damaged: list[Path]
    work: dict[str, Work]
    imports: dict[int, tuple[Batch, float | None]]

    @property
    def missing_runs(self) -> int:
        """Number of missing runs over all configurations."""
        return sum(work.num_runs for work in self.work.values()) + len(self.imports)


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
    old = stored_settings(folder)
    opened = open_scene(plan.scene)
    scene = opened.scene
    check_scene(scene)
    target = target_of_scene(scene, plan.target)
    start = target.scene_start(scene)
    plan = complete(plan, target.name, start.parents)
    settings = resumed(folder, old, plan) if old else new_settings(plan, opened, start)
    if settings["scene"]["digest"] != opened.digest:
        raise InputError(
            f"scene {scene.name!r} has other pictures or boxes than when the evaluation in "
            f"'{folder}' was begun; choose another output folder, or restore the scene."
        )
    results = Results(folder, settings, target.scene_shapes(scene)[1:], start)
    done, damaged = results.survey()
    work, imports = {}, {}
    share = math.ceil(sum(np.sum(~runs) for runs in done) / workers)
    for index, configuration in enumerate(results.configurations):
        if done[index].all():
            continue
        if configuration.is_imported:
            imports[index] = _import(plan, opened, target, configuration.method)
            continue
        most = runs_per_batch or min(share, _most_runs(configuration, scene, start.num_partitions))
        for first, count, blocks in divide(done[index], most):
            work[batch_name(index, first)] = Work(configuration, first, count, blocks)
    return Prepared(plan, results, done, damaged, work, imports)


def _import(plan: Plan, opened: Opened, target: Target, name: str) -> tuple[Batch, float | None]:
    """The one run of a file's tracks, or of computed ones with the seconds that they took.

    Raises:
        InputError: the tracks are of another kind than the objects.
    """
    scene, seconds, given = opened.scene, None, "boxes"
    if name in plan.trackers:
        tracks, seconds = opened.made(name, plan.trackers[name])
        given = "points" if tracks.shape[-1] == 2 else "boxes"
    if given != ("boxes" if target.has_boxes else target.name):
        raise InputError(
            f"{name!r} gives {given}, but the objects of {scene.name!r} are {target.name}; leave "
            "it out."
        )
    if name in plan.tracks:
        ids, path = object_ids(scene), plan.tracks[name]
        tracks = read_boxes_like(path, scene.boxes, ids, start_frame(scene))
    moves = (tracks != tracks[0]).any()
    return imported_batch(tracks[1:], plan.seed), seconds if moves else None


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
    digest, float64 = results.settings["scene"]["digest"], results.settings["float64"]
    run = functools.partial(run_batch, prepared.plan, digest, float64)
    with locked(results.folder, "evaluating"):
        remove_leavings(store.folder)
        for path in prepared.damaged:
            with report_os_errors("replace", path):
                path.unlink(missing_ok=True)
        results.begin()
        speeds = results.speeds
        for index, (batch, seconds) in prepared.imports.items():
            results.write(index, batch)
            if seconds is not None:
                speeds[index] = len(results.truth) / max(seconds, 1e-9)
                results.write_speeds(speeds)
            progress(len(batch))
        for _, arrays in store.made(prepared.work.items(), run, pool):
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


def run_batch(plan: Plan, digest: str, float64: bool, work: Work) -> dict[str, np.ndarray]:
    """Run one batch; returns the fields of a ``Batch``.

    Args:
        plan: complete.
        digest: of the scene, the same in every process.
        float64: whether JAX computes in double precision.
        work: the batch.

    Raises:
        InputError: the scene cannot be opened in this process, or differs from the planned one.
    """
    configuration, first_run, num_runs, blocks = work
    with jax.enable_x64(float64):
        opened, target = open_scene(plan.scene, digest), find_target(plan.target or "")
        start = target.scene_start(opened.scene)
        tracker = tracker_for(plan, opened, target, configuration)
        error = model_error(tracker, start.num_partitions).astype(np.float32)
        keys = run_keys(plan.seed, first_run, num_runs)
        frames = opened.scene.frames[1:]
        recorded = run_blocks(tracker, keys, frames, blocks, record=keep_measures)
    kept = {
        name: np.asarray(value, bool if name == "without_likelihood" else np.float32)
        for name, value in recorded.items()
    }
    return {
        "seeds": np.full(num_runs, plan.seed, np.int64),
        "runs": np.arange(first_run, first_run + num_runs),
        "shapes": shapes_of(tracker, target, start, kept.pop("estimate")).astype(np.float32),
        "model_error": np.broadcast_to(error, (num_runs, *error.shape)),
        **kept,
    }


def tracker_for(plan: Plan, opened: Opened, target: Target, configuration: Configuration) -> Any:
    """The tracker of a configuration, built in or a user's."""
    name = configuration.method
    if configuration.kind == OWN:
        return opened.made(name, plan.trackers[name])[0]
    return tracker_of(opened.scene, target, configuration)


def keep_measures(state: object, summary: Summary) -> dict[str, jax.Array]:
    """Select the values of a frame to store; values missing from a user's summary are NaN."""
    estimate = summary.estimate

    def or_nan(name: str, *shape: int) -> jax.Array:
        value = getattr(summary, name, None)
        return jnp.full(shape, jnp.nan, estimate.dtype) if value is None else value

    hopeless = getattr(summary, "without_likelihood", None)
    return {
        "estimate": estimate,
        "distinct_share": or_nan("distinct_share", *estimate.shape[:-1]),
        "spread": or_nan("spread", *estimate.shape),
        "confidence": or_nan("confidence", *estimate.shape[:-1]),
        "ess": or_nan("ess"),
        "log_evidence": or_nan("log_evidence"),
        "without_likelihood": (
            ~jnp.isfinite(estimate).all(axis=-1) if hopeless is None else hopeless
        ),
    }


def run_keys(seed: int, first_run: int, num_runs: int) -> jax.Array:
    """Keys ``[num_runs]``; run r has ``fold_in(key(seed), r)`` regardless of its batch."""
    numbers = jnp.arange(first_run, first_run + num_runs, dtype=jnp.uint32)
    return jax.vmap(jax.random.fold_in, in_axes=(None, 0))(jax.random.key(seed), numbers)


def imported_batch(shapes: np.ndarray, seed: int) -> Batch:
    """Another tracker's shapes ``[T, P, S]`` as a batch of one run; other measures are NaN."""
    by_object, by_frame = (
        np.full((1, *size), np.nan, np.float32) for size in (shapes.shape[:2], shapes.shape[:1])
    )
    return Batch(
        seeds=np.array([seed], np.int64),
        runs=np.array([0], np.int64),
        shapes=shapes[None].astype(np.float32),
        distinct_share=by_object,
        spread=np.stack(3 * [by_object], axis=-1),
        model_error=np.zeros((1, shapes.shape[1], 3), np.float32),
        confidence=by_object,
        ess=by_frame,
        log_evidence=by_frame,
        without_likelihood=~np.isfinite(shapes[None]).all(axis=-1),
    )
