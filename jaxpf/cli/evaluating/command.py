"""``jaxpf evaluate``: compare methods, orderings and parameters on a scene over many runs."""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli.evaluating.sequences import evaluate_each, scenes_of
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import progress_bar
from jaxpf.cli.shared.flags import as_typed, given_in, picked
from jaxpf.cli.shared.scene_options import (
    SceneCommand,
    SceneOptions,
    names_in,
    pair,
    resolved_scene,
    scene_name,
    scene_parameters,
)
from jaxpf.cli.shared.startup import start_jax, use_compile_cache
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import check_options, option, options_of
from jaxpf.files.locking import LOCK, locked
from jaxpf.running.memory import check_memory
from jaxpf.targets import adapters

#: Options that choose output or computing resources and do not affect results.
_NOT_REPEATED = ("output", "dry_run", "dask", "speed")
#: Filter options with their own flags here, shared by all variants.
_VARIED = ("method", "order", "swap")
#: Maximum number of processes, and of host devices per process, which JAX sets up one by one.
_MOST = 256


@dataclasses.dataclass(frozen=True)
class Compared:
    """Options that choose what to compare, except those of targets and filters."""

    methods: str | None = option(
        None,
        f"Names, with commas: {', '.join(filters.methods())}.  `jaxpf track --help-all` says what "
        "they are; by default sir, ps, dps and sps, as far as they suit the scene, and sir alone "
        "for one object.",
    )
    orders: tuple[str, ...] = option(
        ("given",),
        "Orders of ps, repeatable: 'given' (as the scene lists the objects), 'shifts' (all "
        "circular shifts), or the objects by their place from 1, such as 3,1,2.",
        length=-1,
    )
    swaps: str = option("combinatorial", "For sps: how objects change places.")
    tracks: tuple[str, ...] = option(
        (),
        "NAME=FILE, another tracker's results; repeat it.  In MOT format or with the header "
        "frame,id,x,y,w,h.",
    )
    tracker: tuple[str, ...] = option(
        (),
        "[NAME=]FILE.py:FUNCTION, a tracker of your own; repeat it.  It is a function of the scene "
        "that returns a tracker or boxes [T, P, 4].",
    )
    baseline: tuple[str, ...] = option(
        (),
        "What people would use instead: mil, csrt, kcf, meanshift, still; with commas.  Mil is "
        "OpenCV's, csrt and kcf those of opencv-contrib; boxes of still never move.",
    )


@dataclasses.dataclass(frozen=True)
class Work:
    """Options that choose the number of runs and where they run."""

    runs: int = option(50, "Runs per configuration.")
    seed: int = option(0, "Seed of all runs.")
    workers: int = option(1, "Processes that share the work.", least=1, most=_MOST)
    dask: str | None = option(
        None,
        "The address of a Dask scheduler whose workers share it, such as tcp://127.0.0.1:8786.",
    )
    devices: int | None = option(
        None,
        "Host devices per process over which runs are spread; by default all cores, shared out.",
        least=1,
        most=_MOST,
    )
    memory: int = option(256, "Megabytes that a batch of runs may take.", least=1, most=2**30)
    output: Path | None = option(  # noqa: RUF009
        None,
        "Folder for the results, which a second call continues; jaxpf-NAME by default.",
        flags=("-o",),
    )
    speed: bool = option(
        False, "Also time one run of each method alone.  In frames per second; it compiles again."
    )
    dry_run: bool = option(False, "Show the plan only.")


@dataclasses.dataclass(frozen=True)
class Options(Work, Compared, SceneOptions):
    """Options of ``jaxpf evaluate`` for any target and filter."""

    def __post_init__(self) -> None:
        check_options(self)
        if self.dask and self.workers > 1:
            raise InputError(
                f"--dask brings workers of its own; leave it or --workers {self.workers} out."
            )
        if not all(map(names_in, self.baseline)):
            raise InputError("--baseline names none; leave it out, or name one, such as still.")


@dataclasses.dataclass(frozen=True)
class Request:
    """A comparison.

    Attributes:
        scene: scene name or absolute path.
        options: values of ``Options``, with absolute file paths.
        grid: given options of targets and filters -> value on the command line.
    """

    scene: str
    options: Options
    grid: Mapping[str, Any]

    def table(self) -> dict[str, Any]:
        """Contents of ``run.toml``, in command-line notation."""
        kept = {n: v for n, v in as_typed(self.options).items() if n not in _NOT_REPEATED}
        return {"scene": self.scene, **kept, **self.grid}


def _request(values: Mapping[str, Any]) -> Request:
    options = picked(values, Options)
    tracks = (pair("--tracks", text, lambda path: Path(path).resolve()) for text in options.tracks)
    named = [name for text in options.baseline for name in names_in(text)]
    options = dataclasses.replace(
        options,
        tracks=tuple(f"{name}={path}" for name, path in tracks),
        tracker=tuple(f"{name}={place}" for name, place in map(_own, options.tracker)),
        baseline=tuple(dict.fromkeys(named)),
    )
    owners: list[Any] = [one.target for one in adapters().values()]
    owners += filters.all_filters().values()
    known = options_of(*(one.options for one in owners))
    given = given_in(values)
    grid = {name: given[name] for name in known if name in given and name not in _VARIED}
    return Request(resolved_scene(values["scene"]), options, grid)


def _evaluate(**values: Any) -> None:
    request = _request(values)
    if each := scenes_of(request.scene, request.options.scene_seed):
        varied = [name for name, given in request.grid.items() if len(_values(given)) > 1]
        evaluate_each(request, each, varied, _evaluate_one)
    else:
        _evaluate_one(request)


def _evaluate_one(request: Request) -> None:
    from jaxpf.cli.evaluating.cluster import cluster
    from jaxpf.cli.evaluating.output import print_again, show_plan
    from jaxpf.evaluation import Limits, finished, prepare
    from jaxpf.evaluation.work.execution import num_cores

    options = request.options
    output = options.output or Path(f"jaxpf-{scene_name(request.scene)}")
    plan = _plan(request)
    if (output / LOCK).exists():  # fail early: planning takes minutes
        with locked(output, "evaluating"):
            pass
    results = finished(plan, output)
    if results is not None and options.dry_run:
        click.echo(f"{output}/: finished, nothing left to do")
        return
    if results is not None and not options.speed and print_again(output, plan.runs):
        return
    devices = options.devices or max(1, num_cores() // options.workers)
    start_jax(devices)
    if results is None:
        workers, executor = options.workers, None
        if options.dask:
            there = cluster(options.dask, options.devices)
            executor = click.get_current_context().with_resource(there)
            workers = executor.workers
        limits = Limits(memory=options.memory * 2**20, workers=workers, devices=devices)
        click.echo(f"Reading {request.scene}", err=True)
        if options.baseline:
            click.echo(f"Baselines come first: {', '.join(options.baseline)}", err=True)
        prepared = prepare(plan, output, limits)
        show_plan(prepared, workers, devices)
        check_memory(
            options.workers * prepared.memory,
            "ask for fewer particles, workers or frames, or a smaller --memory",
        )
        if options.dry_run:
            return
        if options.workers > 1:
            from jaxpf.evaluation import local_pool

            executor = local_pool(options.workers, devices, use_compile_cache)
        results = _carry_out(prepared, executor)
    if options.speed:
        from jaxpf.evaluation.speed import measure_speeds

        measure_speeds(
            results,
            plan.trackers,
            lambda label: click.echo(f"Timing one run alone: {label}", err=True),
        )
    _finish(results, request)


command = SceneCommand(
    "evaluate",
    {"Scene": SceneOptions, "What is compared": Compared, "Runs and work": Work},
    _evaluate,
    rare=("target", "scene_seed", "start_frame", "swaps", "devices", "memory", "speed"),
    grid=True,
    without=_VARIED,
    help="""Compare methods on SCENE over many runs, with intervals, and write tables and a report.

    SCENE is the name of a synthetic scene, such as distracter, a folder with a sequence and its
    truth, or a function that makes a scene, file.py:function.  Every method is run with every
    value of every option that it has, with commas between; `jaxpf evaluate SCENE --help` shows
    the options of what is in that scene.

    The same command continues what was interrupted, more --runs are added to those there are, and a
    second call on a finished evaluation does nothing.

    Example: jaxpf evaluate distracter --sharpness 20,30,40,50 --scale 2,2,0.001
    """,
    more="""A folder holds a video or frames with gt.csv and meta.json, a MOTChallenge or an OTB
    sequence.  One that holds several of them, or a file .txt with a scene in each line (and a seed
    after it), is evaluated one after another, with tables over all of them.

    Runs are kept batch by batch.  The results of a seed do not depend on --workers, --devices or
    --memory.""",
)


def _plan(request: Request) -> Any:
    """Build the library's plan from the request."""
    from jaxpf.cli.tracking.user_tracker import OwnTracker
    from jaxpf.evaluation import Plan
    from jaxpf.evaluation.baselines.rivals import baselines
    from jaxpf.evaluation.opening import load_scene

    options = request.options
    tracks = dict(pair("--tracks", text, str) for text in options.tracks)
    trackers = dict(pair("--tracker", text, OwnTracker) for text in options.tracker)
    for flag, found, typed in (
        ("--tracks", tracks, options.tracks),
        ("--tracker", trackers, options.tracker),
    ):
        if len(found) < len(typed):
            raise InputError(f"{flag} gives a name twice; give each file a name of its own.")
    theirs = baselines(options.baseline)
    for name in theirs.keys() & trackers.keys():
        raise InputError(f"--tracker {name!r} is the name of a baseline; give it another one.")
    return Plan(
        scene=functools.partial(
            load_scene,
            source=request.scene,
            seed=options.scene_seed,
            ids=None if options.ids is None else list(options.ids),
            start_frame=options.start_frame,
            num_frames=options.frames,
            parameters=scene_parameters(options.set),
        ),
        methods=None if options.methods is None else names_in(options.methods),
        orders=[_order(text) for text in options.orders],
        swaps=names_in(options.swaps),
        grid={name: _values(value) for name, value in request.grid.items()},
        target=options.target,
        runs=options.runs,
        seed=options.seed,
        tracks=tracks,
        trackers=trackers | theirs,
    )


def _values(typed: Any) -> list[Any]:
    """Parse the values of a grid option: comma-separated names, numbers, or lists of numbers."""
    if isinstance(typed, str):
        return names_in(typed)
    entries = [typed] if isinstance(typed, bool) else typed
    return [tuple(entry) if isinstance(entry, list) else entry for entry in entries]


def _order(text: str) -> Any:
    """Convert an order from 1-based to 0-based indices."""
    if text in ("given", "shifts"):
        return text
    entries = text.split(",")
    if not all(entry.strip().isdecimal() and int(entry) > 0 for entry in entries):
        raise InputError(
            f"--orders {text!r} is no order; write 'given', 'shifts', or the objects by their "
            "place from 1, such as 3,1,2."
        )
    return tuple(int(entry) - 1 for entry in entries)


def _own(text: str) -> tuple[str, str]:
    """Name and absolute path of a user-defined tracker; its name defaults to the function's."""
    name, equals, place = text.partition("=")
    if not equals:
        name, place = text.rpartition(":")[2], text
    path, colon, function = place.rpartition(":")
    return name, f"{Path(path).resolve()}:{function}" if colon else place


def _carry_out(prepared: Any, executor: Any) -> Any:
    """Run the missing work behind a progress bar; on interruption, say how to resume."""
    from jaxpf.cli.evaluating.output import FINISHED
    from jaxpf.evaluation import carry_out
    from jaxpf.evaluation.speed import keep_speeds

    (prepared.folder / FINISHED).unlink(missing_ok=True)  # it describes fewer runs
    try:
        with progress_bar("runs") as bar:
            name = prepared.settings["scene"]["name"]
            task = bar.add_task(f"{name}: compiling", total=prepared.missing_runs)

            def progress(runs: int) -> None:
                bar.update(task, advance=runs, description=name)

            results = carry_out(prepared, executor=executor, progress=progress)
        if prepared.import_seconds:
            keep_speeds(results, prepared.import_seconds)
        return results
    except KeyboardInterrupt:
        click.echo(
            f"Finished runs are kept in '{prepared.folder}'; the same command continues.", err=True
        )
        raise


def _finish(results: Any, request: Request) -> None:
    """Write tables, report and the file that repeats the evaluation; then print the results."""
    from jaxpf.cli.evaluating.output import print_results
    from jaxpf.evaluation.output.report import write_report
    from jaxpf.evaluation.output.tables import write_tables

    write_config(results.folder / "run.toml", "evaluate", request.table())
    tables = write_tables(results)
    write_report(results, tables)
    print_results(results, tables)
