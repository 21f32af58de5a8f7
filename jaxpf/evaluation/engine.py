"""Executes an evaluation: runs the missing batches and stores each one."""

import dataclasses
import functools
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import InputError, check_type
from jaxpf.evaluation.batches import Batch, batch_name
from jaxpf.evaluation.fingerprint import fingerprint
from jaxpf.evaluation.folder import stored_settings, write_settings
from jaxpf.evaluation.plan import DEFAULT_LIMITS, Limits, Plan
from jaxpf.evaluation.results import Configuration, Results
from jaxpf.evaluation.scene import (
    check_scene,
    object_ids,
    open_scene,
    remember_scene,
    same_scene,
    start_frame,
)
from jaxpf.files.executors import RETRIES, Pool as Pool, local_pool as local_pool
from jaxpf.files.store import locked
from jaxpf.files.writing import remove_leavings, report_os_errors
from jaxpf.targets import target_of_scene
from jaxpf.targets.target import Target

if TYPE_CHECKING:
    from jaxpf.evaluation.worker import Work
    from scenes import Scene


@dataclasses.dataclass(frozen=True)
class Prepared:
    """An evaluation that is ready to run.

    Attributes:
        plan: the requested plan.
        scene: its opened scene.
        target: the kind of its objects.
        results: what is on disk, with settings, truth and configurations.
        done: bool ``[R]`` per configuration, whether each run is on disk.
        damaged: damaged batch files; their runs count as missing.
        work: missing batches.
        imports: missing imported tracks, as (index of the configuration, batch).
        import_seconds: seconds to make the tracks in ``imports`` that were computed here, by
            index.
        memory: estimated bytes per worker process.
    """

    plan: Plan
    scene: "Scene"
    target: Target
    results: Results
    done: list[np.ndarray]
    damaged: list[Path]
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
    pool: Pool | None = None,
    progress: Callable[[int], None] = lambda runs: None,
    limits: Limits = DEFAULT_LIMITS,
    retries: int = RETRIES,
) -> Results:
    """Run every configuration of a plan and store each finished batch.

    The same call resumes, or adds runs if ``plan.runs`` is larger.  On one machine, the results of
    a seed are identical bit for bit for any batches, pool, and number of workers or devices.
    With another number of runs, blocks may have other widths (``jaxpf.running.widths.blocks_of``)
    and results can differ by rounding.

    Args:
        plan: what to run.
        folder: new, empty, or of the same evaluation.
        pool: the workers, such as ``local_pool(4)`` or ``Pool(client.get_executor, 8)`` of Dask; by
            default this process.
        progress: called with the number of newly finished runs after each batch.
        limits: on the division of runs into batches.
        retries: times that a batch may be repeated because a worker died.

    Raises:
        InputError: the folder has other settings or another version; the scene cannot be opened or
            an object is absent in its first frame; an argument is out of range; the disk is full;
            workers died too often.
    """
    prepared = prepare(plan, folder, limits)
    return carry_out(prepared, pool=pool, progress=progress, retries=retries)


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
    done, damaged = results.survey()
    return results if not damaged and all(runs.all() for runs in done) else None


def prepare(
    plan: Plan, folder: str | os.PathLike[str], limits: Limits = DEFAULT_LIMITS
) -> Prepared:
    """Determine the missing work without writing; arguments and errors as for ``evaluate``."""
    check_type("limits", limits, Limits)
    check_type("plan", plan, Plan)
    folder = Path(folder)
    settings = stored_settings(plan, folder)
    from jaxpf.evaluation.schedule import batches
    from jaxpf.evaluation.settings import check_continues, new_settings

    scene = open_scene(plan.scene)
    check_scene(scene)
    target = target_of_scene(scene, plan.target)
    start = target.scene_start(scene)
    if settings is None:
        settings = new_settings(plan, scene, target, start)
    else:
        check_continues(settings, scene, folder)
        about_scene = {**settings["scene"], "files": fingerprint(plan.scene)}
        settings = {**settings, "runs": plan.runs, "scene": about_scene}
    digest = settings["scene"]["digest"]
    reopen = functools.partial(same_scene, plan.scene, digest)
    results = Results(folder, settings, target.scene_shapes(scene)[1:], start, reopen)
    done, damaged = results.survey()
    configurations = results.configurations
    remember_scene(scene, digest)
    work, memory = batches(plan, scene, target, digest, configurations, done, limits)
    imports = {
        index: _imported(plan, scene, target, configuration)
        for index, configuration in enumerate(configurations)
        if configuration.is_imported and not done[index].all()
    }
    return Prepared(
        plan=plan,
        scene=scene,
        target=target,
        results=results,
        done=done,
        damaged=damaged,
        work=work,
        imports=[(index, batch) for index, (batch, _) in imports.items()],
        import_seconds={i: seconds for i, (_, seconds) in imports.items() if seconds is not None},
        memory=memory,
    )


def carry_out(
    prepared: Prepared,
    *,
    pool: Pool | None = None,
    progress: Callable[[int], None] = lambda runs: None,
    retries: int = RETRIES,
) -> Results:
    """Run what ``prepare`` found missing; arguments and errors as for ``evaluate``."""
    from jaxpf.evaluation.worker import run_batch

    results, store = prepared.results, prepared.results.store
    work = ((batch_name(each.index, each.first_run), each) for each in prepared.work)
    with locked(results.folder, "evaluating"):
        remove_leavings(store.folder)
        for path in prepared.damaged:
            with report_os_errors("replace", path):
                path.unlink(missing_ok=True)
        write_settings(results.folder, results.settings, results.truth, results.start)
        for index, batch in prepared.imports:
            results.write(index, batch)
            progress(len(batch))
        for _, arrays in store.made(work, run_batch, pool, retries):
            progress(len(arrays["runs"]))
    return results


def _imported(
    plan: Plan, scene: "Scene", target: Target, configuration: Configuration
) -> tuple[Batch, float | None]:
    """Read or compute another tracker's tracks; also the seconds that computing them took."""
    from jaxpf.evaluation.trackers import own_tracker
    from jaxpf.evaluation.worker import imported_batch

    name = configuration.method
    boxes, seconds = None, None
    if name in plan.trackers:
        function: Any = plan.trackers[name]
        began = time.perf_counter()
        boxes = own_tracker(name, function, scene)
        seconds = time.perf_counter() - began
        if hasattr(function, "seconds"):  # a baseline caches its boxes, so ask it
            seconds = function.seconds(scene)
    elif target.has_boxes:
        from jaxpf.evaluation.other_tracks import read_tracks

        boxes = read_tracks(plan.tracks[name], scene.boxes, object_ids(scene), start_frame(scene))
    given = "points" if boxes is not None and boxes.shape[-1] == 2 else "boxes"
    if boxes is None or given != ("boxes" if target.has_boxes else target.name):
        raise InputError(
            f"{name!r} gives {given}, but the objects of {scene.name!r} are {target.name}; leave "
            "it out."
        )
    return imported_batch(boxes[1:], plan.seed), seconds
