"""Executes an evaluation: runs the missing batches and stores each one."""

import functools
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError, check_type
from jaxpf.contract.numbers import check_whole
from jaxpf.evaluation.plan import DEFAULT_LIMITS, Limits, Plan
from jaxpf.evaluation.work.batches import Batch, survey, write_batch
from jaxpf.evaluation.work.execution import RETRIES, Factory, Pool, in_turn
from jaxpf.evaluation.work.fingerprint import fingerprint
from jaxpf.evaluation.work.folder import remove_leavings, stored_settings, write_settings
from jaxpf.evaluation.work.results import Configuration, Results
from jaxpf.evaluation.work.scene import (
    check_scene,
    object_ids,
    open_scene,
    remember_scene,
    remembered_scene,
    start_frame,
)
from jaxpf.files.locking import locked
from jaxpf.files.writing import report_os_errors
from jaxpf.targets import adapter_of_scene
from jaxpf.targets.adapter import Adapter
from jaxpf.targets.target import Start

if TYPE_CHECKING:
    from jaxpf.evaluation.work.worker import Work


class Opened(NamedTuple):
    """A plan with its opened scene.

    Attributes:
        plan: the requested plan.
        folder: for the results.
        scene: the scene.
        adapter: for the type of its objects.
        start: state of the objects in the start frame.
        truth: ``[T, P, S]`` in the frames after the start frame.
        stored: settings of the evaluation that is resumed; None for a new one.
    """

    plan: Plan
    folder: Path
    scene: Any
    adapter: Adapter
    start: Start
    truth: np.ndarray
    stored: dict[str, Any] | None


class Settled(NamedTuple):
    """What an evaluation runs, and what is done of it.

    Attributes:
        settings: for ``settings.json``.
        configurations: all configurations.
        done: bool ``[R]`` per configuration, whether each run is on disk.
        damaged: damaged batch files; their runs count as missing.
    """

    settings: dict[str, Any]
    configurations: list[Configuration]
    done: list[np.ndarray]
    damaged: list[Path]


class Prepared(NamedTuple):
    """An evaluation that is ready to run.

    Attributes:
        opened: the plan with its scene.
        settled: its configurations and finished runs.
        work: missing batches.
        imports: missing imported tracks, as (index of the configuration, batch).
        import_seconds: seconds to make the tracks in ``imports`` that were computed here, by
            index.
        memory: estimated bytes per worker process.
    """

    opened: Opened
    settled: Settled
    work: list["Work"]
    imports: list[tuple[int, Batch]]
    import_seconds: dict[int, float]
    memory: int

    @property
    def missing_runs(self) -> int:
        """Number of missing runs over all configurations."""
        return sum(work.num_runs for work in self.work) + len(self.imports)


def evaluate(
    plan: Plan,
    folder: str | os.PathLike[str],
    *,
    executor: Executor | Factory | Pool | None = None,
    progress: Callable[[int], None] | None = None,
    limits: Limits = DEFAULT_LIMITS,
    retries: int = RETRIES,
) -> Results:
    """Run every configuration of a plan and store each finished batch.

    The same call resumes, or adds runs if ``plan.runs`` is larger.  On one machine, the results of
    a seed are identical bit for bit for any batches, executor, and number of workers or devices.
    With another number of runs, blocks may have other widths (``jaxpf.running.widths.blocks_of``)
    and results can differ by rounding.

    Args:
        plan: what to run.
        folder: new, empty, or of the same evaluation.
        executor: any ``concurrent.futures.Executor``, or a function without arguments that returns
            one, so that a broken executor can be replaced; by default this process.  See
            ``execution.local_pool``.
        progress: called with the number of newly finished runs after each batch.
        limits: on the division of runs into batches.
        retries: times that a batch may be repeated because a worker died.

    Raises:
        InputError: the folder has other settings or another version; the scene cannot be opened or
            an object is absent in its first frame; an argument is out of range; the disk is full;
            workers died too often.
    """
    check_whole("retries", retries, 0)
    for name, value in (("executor", executor), ("progress", progress)):
        if not (value is None or callable(value) or isinstance(value, Executor)):
            raise InputError(f"{name}={value!r:.60} must be a function; see evaluate.")
    prepared = prepare(plan, folder, limits)
    return carry_out(prepared, executor=executor, progress=progress, retries=retries)


def finished(plan: Plan, folder: str | os.PathLike[str]) -> Results | None:
    """The results of an evaluation if it is complete, else None.

    This needs neither the scene nor JAX, and reads every batch to its end.  If the scene's files
    have changed, it returns None; ``prepare`` then checks the scene itself.

    Raises:
        InputError: the folder has other settings or another version.
    """
    folder = Path(folder)
    settings = stored_settings(plan, folder)
    if settings is None or settings["runs"] != plan.runs:
        return None
    if settings["scene"].get("files") != fingerprint(plan.scene):
        return None
    results = Results.open(folder, functools.partial(open_scene, plan.scene))
    done, damaged = _surveyed(results, plan.runs)
    return results if not damaged and all(runs.all() for runs in done) else None


def prepare(
    plan: Plan, folder: str | os.PathLike[str], limits: Limits = DEFAULT_LIMITS
) -> Prepared:
    """Determine the missing work without writing; arguments and errors as for ``evaluate``."""
    check_type("limits", limits, Limits)
    opened = open_evaluation(plan, folder)
    return divide_work(opened, settle(opened), limits)


def open_evaluation(plan: Plan, folder: str | os.PathLike[str]) -> Opened:
    """Open the scene of a plan, and read the settings of the evaluation that it resumes.

    Raises:
        InputError: see ``evaluate``.
    """
    check_type("plan", plan, Plan)
    stored = stored_settings(plan, Path(folder))
    scene = open_scene(plan.scene)
    check_scene(scene)
    adapter = adapter_of_scene(scene, plan.target)
    start, truth = adapter.scene_start(scene), adapter.scene_shapes(scene)[1:]
    return Opened(plan, Path(folder), scene, adapter, start, truth, stored)


def settle(opened: Opened) -> Settled:
    """Settle the configurations, or read those of a resumed evaluation and find its runs.

    Raises:
        InputError: see ``evaluate``.
    """
    from jaxpf.evaluation.work.settings import check_continues, new_settings

    plan, scene, settings = opened.plan, opened.scene, opened.stored
    if settings is None:
        settings = new_settings(plan, scene, opened.adapter.target, opened.start)
    else:
        check_continues(settings, scene, opened.folder)
        about_scene = {**settings["scene"], "files": fingerprint(plan.scene)}
        settings = {**settings, "runs": plan.runs, "scene": about_scene}
    results = Results(opened.folder, settings, opened.truth, opened.start)
    return Settled(settings, results.configurations, *_surveyed(results, plan.runs))


def divide_work(opened: Opened, settled: Settled, limits: Limits = DEFAULT_LIMITS) -> Prepared:
    """Divide the missing runs into batches, and read or compute missing imported tracks.

    Raises:
        InputError: see ``evaluate``.
    """
    from jaxpf.evaluation.work.schedule import batches

    digest = settled.settings["scene"]["digest"]
    remember_scene(opened.scene, digest)
    work, memory = batches(
        opened.plan,
        opened.scene,
        opened.adapter,
        digest,
        settled.configurations,
        settled.done,
        limits,
    )
    imports = list(_missing_imports(opened, settled))
    return Prepared(
        opened=opened,
        settled=settled,
        work=work,
        imports=[(index, batch) for index, batch, _ in imports],
        import_seconds={index: seconds for index, _, seconds in imports if seconds is not None},
        memory=memory,
    )


def carry_out(
    prepared: Prepared,
    *,
    executor: Executor | Factory | Pool | None = None,
    progress: Callable[[int], None] | None = None,
    retries: int = RETRIES,
) -> Results:
    """Run what ``prepare`` found missing; arguments and errors as for ``evaluate``."""
    from jaxpf.evaluation.work.worker import run_batch

    opened, settled = prepared.opened, prepared.settled
    folder = opened.folder
    with locked(folder, "evaluating"):
        remove_leavings(folder)
        for path in settled.damaged:
            with report_os_errors("replace", path):
                path.unlink(missing_ok=True)
        write_settings(folder, settled.settings, opened.truth, opened.start)
        for index, batch in prepared.imports:
            write_batch(folder, index, batch)
            if progress is not None:
                progress(1)
        for work, batch in in_turn(run_batch, prepared.work, executor, retries=retries):
            write_batch(folder, work.index, batch)
            if progress is not None:
                progress(work.num_runs)
    digest = settled.settings["scene"]["digest"]
    return Results.open(folder, functools.partial(_remembered, digest, opened.plan.scene))


def _remembered(digest: str, scene: Any) -> Any:
    """Return this process's open scene if there is one, to avoid a second copy; else open it."""
    remembered = remembered_scene(digest)
    return open_scene(scene) if remembered is None else remembered


def _surveyed(results: Results, num_runs: int) -> tuple[list[np.ndarray], list[Path]]:
    """Finished runs of each configuration as bool arrays, and the damaged files."""
    done, damaged = [], []
    for index, configuration in enumerate(results.configurations):
        wanted = 1 if configuration.is_imported else num_runs
        runs, broken = survey(results.folder, index, wanted, results.truth.shape)
        done.append(runs)
        damaged += broken
    return done, damaged


def _missing_imports(opened: Opened, settled: Settled) -> Iterator[tuple[int, Batch, float | None]]:
    """Yield (index, batch, seconds or None) for imported tracks that are not on disk."""
    from jaxpf.evaluation.work.trackers import own_tracker
    from jaxpf.evaluation.work.worker import imported_batch

    plan, scene, target = opened.plan, opened.scene, opened.adapter.target
    for index, configuration in enumerate(settled.configurations):
        if not configuration.is_imported or settled.done[index].all():
            continue
        name = configuration.method
        if not target.has_boxes:
            raise InputError(
                f"{name!r} gives boxes, but the objects of {scene.name!r} are {target.name}; "
                "leave it out."
            )
        seconds: float | None = None
        if name in plan.trackers:
            function: Any = plan.trackers[name]
            began = time.perf_counter()
            boxes = own_tracker(name, function, scene)
            seconds = time.perf_counter() - began
            if hasattr(function, "seconds"):  # a baseline caches its boxes, so ask it
                seconds = function.seconds(scene)
        else:
            from jaxpf.evaluation.work.other_tracks import read_tracks

            boxes = read_tracks(
                plan.tracks[name], scene.boxes, object_ids(scene), start_frame(scene)
            )
        yield index, imported_batch(boxes[1:], plan.seed), seconds
