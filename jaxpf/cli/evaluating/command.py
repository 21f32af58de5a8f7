"""``jaxpf evaluate``: compare methods, orderings and parameters on a scene over many runs.

A request is parsed, opened, settled, built, run and finished; each step returns a new value.
"""

from typing import Any, NamedTuple

import click

from jaxpf.cli.evaluating.output import FINISHED, print_again, print_results, show_plan
from jaxpf.cli.evaluating.request import VARIED, Compared, Request, Work, parse
from jaxpf.cli.evaluating.sequences import evaluate_each
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import progress_bar
from jaxpf.cli.shared.flags import report_implied
from jaxpf.cli.shared.scene_options import SceneCommand, SceneOptions
from jaxpf.cli.shared.startup import start_jax, use_compile_cache
from jaxpf.files.locking import LOCK, locked
from jaxpf.running.memory import check_memory

_LESS_MEMORY = "ask for fewer particles, workers or frames, or a smaller --memory"


class _Opened(NamedTuple):
    """The opened scene, and where its runs are computed.

    Attributes:
        evaluation: the opened scene, see ``jaxpf.evaluation.Opened``.
        devices: host devices per process.
        pool: processes or Dask workers; None for this process.
    """

    evaluation: Any
    devices: int
    pool: Any

    @property
    def workers(self) -> int:
        """Number of processes."""
        return self.pool.workers if self.pool else 1


def _command(**values: Any) -> None:
    from jaxpf.sequences.layouts import sequences_in

    request = parse(values)
    if sequences := sequences_in(request.scene):
        evaluate_each(request, sequences, _evaluate)
    else:
        _evaluate(request)


def _evaluate(request: Request) -> None:
    """Evaluate one scene."""
    if _is_finished(request):
        return
    opened = _open(request)
    prepared = _build(request, opened, _settle(opened))
    if not request.options.dry_run:
        _finish(request, _run(request, opened, prepared))


def _is_finished(request: Request) -> bool:
    """Whether nothing is left to do; if so, print the results again."""
    from jaxpf.evaluation import finished

    if (request.output / LOCK).exists():  # fail early: planning takes minutes
        with locked(request.output, "evaluating"):
            pass
    if finished(request.plan, request.output) is None:
        return False
    if request.options.dry_run:
        click.echo(f"{request.output}/: finished, nothing left to do")
        return True
    return not request.options.speed and print_again(request.output, request.plan.runs)


def _open(request: Request) -> _Opened:
    """Start JAX, connect to workers, and open the scene.

    Raises:
        InputError: no scheduler answers, or the scene cannot be opened.
    """
    from jaxpf.evaluation import local_pool, open_evaluation

    options, pool = request.options, None
    devices = start_jax(options.devices, options.workers)
    if options.dask:
        from jaxpf.cli.shared.cluster import cluster

        pool = click.get_current_context().with_resource(cluster(options.dask, options.devices))
    elif options.workers > 1:
        pool = local_pool(options.workers, devices, use_compile_cache)
    click.echo(f"Reading {request.scene}", err=True)
    opened = open_evaluation(request.plan, request.output)
    target = opened.adapter.target
    report_implied(request.grid, target.resolved(target.options(), opened.scene.settings))
    return _Opened(opened, devices, pool)


def _settle(opened: _Opened) -> Any:
    """Settle configurations and find finished runs; see ``jaxpf.evaluation.Settled``."""
    from jaxpf.evaluation import settle

    return settle(opened.evaluation)


def _build(request: Request, opened: _Opened, settled: Any) -> Any:
    """Divide the missing work, if any, and print the plan; see ``jaxpf.evaluation.Prepared``.

    Raises:
        InputError: the work does not fit in memory.
    """
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
    from jaxpf.evaluation import carry_out
    from jaxpf.evaluation.work.speed import keep_speeds, measure_speeds

    (request.output / FINISHED).unlink(missing_ok=True)  # it describes fewer runs
    try:
        with progress_bar("runs") as bar:
            name = opened.evaluation.scene.name
            task = bar.add_task(f"{name}: compiling", total=prepared.missing_runs)

            def progress(runs: int) -> None:
                bar.update(task, advance=runs, description=name)

            results = carry_out(prepared, executor=opened.pool, progress=progress)
    except KeyboardInterrupt:
        click.echo(
            f"Finished runs are kept in '{request.output}'; the same command continues.", err=True
        )
        raise
    if prepared.import_seconds:
        keep_speeds(results, prepared.import_seconds)
    if request.options.speed:

        def announce(label: str) -> None:
            click.echo(f"Timing one run alone: {label}", err=True)

        measure_speeds(results, request.plan.trackers, announce)
    return results


def _finish(request: Request, results: Any) -> None:
    """Write tables, report and the file that repeats the evaluation; then print the results."""
    from jaxpf.evaluation.output.report import write_report
    from jaxpf.evaluation.output.tables import write_tables

    write_config(results.folder / "run.toml", "evaluate", request.table())
    overview = write_tables(results)
    write_report(results, overview)
    print_results(results, overview)


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
