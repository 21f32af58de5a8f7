"""``jaxpf evaluate``: compare methods, orderings and parameters on a scene over many runs.

A request is parsed, prepared, run and finished; each step returns a new value.
"""

from typing import TYPE_CHECKING, Any

import click

from jaxpf import evaluation
from jaxpf.cli.evaluating.output import FINISHED, print_again, print_results, show_plan
from jaxpf.cli.evaluating.request import VARIED, Compared, Request, Work, parse
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import progress_bar, say
from jaxpf.cli.shared.flags import report_implied
from jaxpf.cli.shared.scene_options import SceneCommand, SceneOptions
from jaxpf.cli.shared.startup import start_jax, use_compile_cache
from jaxpf.files.store import LOCK, locked
from jaxpf.files.writing import check_output_folder
from jaxpf.running.memory import check_memory

if TYPE_CHECKING:
    import pandas as pd

    from jaxpf.evaluation.work.engine import Prepared
    from jaxpf.evaluation.work.results import Results

_LESS_MEMORY = "ask for fewer particles, workers or frames, or a smaller --memory"


def _command(**values: Any) -> None:
    from jaxpf.sequences.layouts import sequences_in

    request = parse(values)
    if sequences := sequences_in(request.scene):
        from jaxpf.cli.evaluating.sequences import evaluate_each

        evaluate_each(request, sequences, _evaluate)
    else:
        _evaluate(request)


def _evaluate(request: Request) -> "dict[str, pd.DataFrame] | None":
    """Evaluate one scene; returns its tables, or None if nothing was left to do or is done."""
    if _is_finished(request):
        return None
    prepared, pool = _prepare(request)
    return None if request.options.dry_run else _finish(request, _run(request, prepared, pool))


def _is_finished(request: Request) -> bool:
    """Whether nothing is left to do; if so, print the results again."""
    check_output_folder(request.output)
    if (request.output / LOCK).exists():  # fail early: planning takes minutes
        with locked(request.output, "evaluating"):
            pass
    if evaluation.finished(request.plan, request.output) is None:
        return False
    if request.options.dry_run:
        say(f"{request.output}/: finished, nothing left to do")
        return True
    return not request.options.speed and print_again(request.output, request.plan.runs)


def _prepare(request: Request) -> "tuple[Prepared, Any]":
    """Start JAX, connect to workers, open the scene and print the plan of what is missing.

    Returns:
        ``jaxpf.evaluation.Prepared``, and processes or Dask workers; None for this process.

    Raises:
        InputError: no scheduler answers, the scene cannot be opened, or the work does not fit in
            memory.
    """
    options, pool = request.options, None
    devices = start_jax(options.devices, options.workers)
    if options.dask:
        from jaxpf.cli.shared.cluster import cluster

        pool = click.get_current_context().with_resource(cluster(options.dask, options.devices))
    elif options.workers > 1:
        pool = evaluation.local_pool(options.workers, devices, use_compile_cache)
    workers = pool.workers if pool else 1
    say(f"Reading {request.scene}", err=True)
    if options.baseline:
        say(f"Baselines come first: {', '.join(options.baseline)}", err=True)
    limits = evaluation.Limits(options.memory * 2**20, workers=workers, devices=devices)
    prepared = evaluation.prepare(request.plan, request.output, limits)
    target = prepared.target
    report_implied(request.grid, target.resolved(target.options(), prepared.scene.settings))
    if prepared.missing_runs:
        show_plan(prepared, workers, devices)
    check_memory(options.workers * prepared.memory, _LESS_MEMORY)
    return prepared, pool


def _run(request: Request, prepared: "Prepared", pool: Any) -> "Results":
    """Run the missing work behind a progress bar, then measure speeds.

    An interruption keeps the finished runs and says how to resume.
    """
    from jaxpf.evaluation.work.speed import keep_speeds, measure_speeds

    (request.output / FINISHED).unlink(missing_ok=True)  # it describes fewer runs
    try:
        with progress_bar("runs") as bar:
            name = prepared.scene.name
            task = bar.add_task(f"{name}: compiling", total=prepared.missing_runs)

            def progress(runs: int) -> None:
                bar.update(task, advance=runs, description=name)

            results = evaluation.carry_out(prepared, pool=pool, progress=progress)
    except KeyboardInterrupt:
        say(f"Finished runs are kept in '{request.output}'; the same command continues.", err=True)
        raise
    if prepared.import_seconds:
        keep_speeds(results, prepared.import_seconds)
    if request.options.speed:

        def announce(label: str) -> None:
            say(f"Timing one run alone: {label}", err=True)

        measure_speeds(results, request.plan.trackers, announce)
    return results


def _finish(request: Request, results: "Results") -> "dict[str, pd.DataFrame]":
    """Write tables, report and the file that repeats the evaluation; then print the results."""
    from jaxpf.evaluation.output.report import write_report
    from jaxpf.evaluation.output.tables import write_tables

    write_config(results.folder / "run.toml", "evaluate", request.table())
    overview = write_tables(results)
    write_report(results, overview)
    print_results(results, overview)
    return overview.tables


command = SceneCommand(
    "evaluate",
    {"Scene": SceneOptions, "What is compared": Compared, "Runs and work": Work},
    _command,
    rare=("target", "scene_seed", "start_frame", "swaps", "devices", "memory", "speed"),
    grid=True,
    without=VARIED,
    help="""Compare methods on SCENE over many runs, with intervals, and write tables and a report.

    SCENE is a folder with a sequence and its truth, a folder of such folders, the name of a
    synthetic scene, such as distracter, or a function that makes a scene, file.py:function.
    Comma-separated values of options are all combined; `jaxpf evaluate SCENE --help` shows the
    options for the objects in that scene.

    The same command resumes after an interruption, or adds runs if --runs is larger.

    Examples: jaxpf evaluate distracter --sharpness 20,30,40,50

    jaxpf evaluate FOLDER --baseline all --speed
    """,
    more="""A sequence is a folder with a video or frames, gt.csv and meta.json, or a MOTChallenge
    or OTB sequence.  The sequences of a folder are evaluated one after another.  Tables over all of
    them have intervals over the sequences.

    Runs are stored batch by batch.  The results of a seed do not depend on --workers, --devices or
    --memory.""",
)
