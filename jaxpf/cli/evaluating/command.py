"""``jaxpf evaluate``: compare methods, orderings and parameters on a scene over many runs.

A request is parsed, opened, settled, built, run and finished; each step returns a new value.
"""

from typing import Any, NamedTuple

import click

from jaxpf.cli.evaluating.request import VARIED, Compared, Request, Work, plan_of, request_of
from jaxpf.cli.evaluating.sequences import evaluate_each
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import progress_bar
from jaxpf.cli.shared.flags import report_implied
from jaxpf.cli.shared.scene_options import SceneCommand, SceneOptions
from jaxpf.cli.shared.startup import start_jax, use_compile_cache
from jaxpf.files.locking import LOCK, locked
from jaxpf.running.memory import check_memory
from jaxpf.targets.adapter import is_filmed

_LESS_MEMORY = "ask for fewer particles, workers or frames, or a smaller --memory"


class _Opened(NamedTuple):
    """The opened scene, see ``jaxpf.evaluation.Opened``, and where its runs are computed.

    Attributes:
        evaluation: the opened scene.
        devices: host devices per process.
        workers: number of processes.
        pool: processes or Dask workers; None for this process.
    """

    evaluation: Any
    devices: int
    workers: int
    pool: Any


def _command(**values: Any) -> None:
    from scenes.sequences import sequences_in

    request = request_of(values)
    if sequences := sequences_in(request.scene):
        evaluate_each(request, sequences, _evaluate)
    else:
        _evaluate(request)


def _evaluate(request: Request) -> None:
    """Evaluate one scene."""
    plan = plan_of(request)
    if _is_finished(request, plan):
        return
    opened = _open(request, plan)
    settled = _settle(opened)
    prepared = _build(request, opened, settled)
    if not request.options.dry_run:
        results = _run(request, opened, prepared)
        _finish(request, results)


def _is_finished(request: Request, plan: Any) -> bool:
    """Whether nothing is left to do; if so, print the results again."""
    from jaxpf.cli.evaluating.output import print_again
    from jaxpf.evaluation import finished

    if (request.output / LOCK).exists():  # fail early: planning takes minutes
        with locked(request.output, "evaluating"):
            pass
    if finished(plan, request.output) is None:
        return False
    if request.options.dry_run:
        click.echo(f"{request.output}/: finished, nothing left to do")
        return True
    return not request.options.speed and print_again(request.output, plan.runs)


def _open(request: Request, plan: Any) -> _Opened:
    """Start JAX, connect to workers, and open the scene.

    Raises:
        InputError: no scheduler answers, or the scene cannot be opened.
    """
    from jaxpf.cli.evaluating.cluster import cluster
    from jaxpf.evaluation import local_pool, open_evaluation
    from jaxpf.evaluation.work.execution import num_cores

    options, pool = request.options, None
    devices = options.devices or max(1, num_cores() // options.workers)
    start_jax(devices)
    if options.dask:
        pool = click.get_current_context().with_resource(cluster(options.dask, options.devices))
    elif options.workers > 1:
        pool = local_pool(options.workers, devices, use_compile_cache)
    click.echo(f"Reading {request.scene}", err=True)
    opened = open_evaluation(plan, request.output)
    target = opened.adapter.target
    report_implied(request.grid, target.resolved(target.options(), is_filmed(opened.scene)))
    return _Opened(opened, devices, pool.workers if pool else 1, pool)


def _settle(opened: _Opened) -> Any:
    """Settle configurations and find finished runs; see ``jaxpf.evaluation.Settled``."""
    from jaxpf.evaluation import settle

    return settle(opened.evaluation)


def _build(request: Request, opened: _Opened, settled: Any) -> Any:
    """Divide the missing work, if any, and print the plan; see ``jaxpf.evaluation.Prepared``.

    Raises:
        InputError: the work does not fit in memory.
    """
    from jaxpf.cli.evaluating.output import show_plan
    from jaxpf.evaluation import Limits, divide_work

    options = request.options
    if options.baseline:
        click.echo(f"Baselines come first: {', '.join(options.baseline)}", err=True)
    limits = Limits(options.memory * 2**20, workers=opened.workers, devices=opened.devices)
    prepared = divide_work(opened.evaluation, settled, limits)
    if prepared.missing_runs:
        show_plan(prepared, opened.workers, opened.devices)
    check_memory(options.workers * prepared.memory, _LESS_MEMORY)
    return prepared


def _run(request: Request, opened: _Opened, prepared: Any) -> Any:
    """Run the missing work behind a progress bar, then measure speeds.

    An interruption keeps the finished runs and says how to resume.
    """
    from jaxpf.cli.evaluating.output import FINISHED
    from jaxpf.evaluation import carry_out
    from jaxpf.evaluation.speed import keep_speeds, measure_speeds

    (prepared.folder / FINISHED).unlink(missing_ok=True)  # it describes fewer runs
    try:
        with progress_bar("runs") as bar:
            name = prepared.settings["scene"]["name"]
            task = bar.add_task(f"{name}: compiling", total=prepared.missing_runs)

            def progress(runs: int) -> None:
                bar.update(task, advance=runs, description=name)

            results = carry_out(prepared, executor=opened.pool, progress=progress)
    except KeyboardInterrupt:
        click.echo(
            f"Finished runs are kept in '{prepared.folder}'; the same command continues.", err=True
        )
        raise
    if prepared.import_seconds:
        keep_speeds(results, prepared.import_seconds)
    if request.options.speed:

        def announce(label: str) -> None:
            click.echo(f"Timing one run alone: {label}", err=True)

        measure_speeds(results, prepared.plan.trackers, announce)
    return results


def _finish(request: Request, results: Any) -> None:
    """Write tables, report and the file that repeats the evaluation; then print the results."""
    from jaxpf.cli.evaluating.output import print_results
    from jaxpf.evaluation.output.report import write_report
    from jaxpf.evaluation.output.tables import write_tables

    write_config(results.folder / "run.toml", "evaluate", request.table())
    tables = write_tables(results)
    write_report(results, tables)
    print_results(results, tables)


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
