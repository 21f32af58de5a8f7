"""``jaxpf evaluate``: methods, orderings and parameters compared on one scene, over many runs."""

import functools
import json
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli import common
from jaxpf.cli.memory import check_memory
from jaxpf.cli.options import all_options, declared_options
from jaxpf.errors import InputError
from jaxpf.targets import targets

#: Options that say where results go or how they are computed, not what they are.
_NOT_REPEATED = ("config", "output", "dry_run")
#: Options of a filter that have flags of their own here, for all their variants.
#: Processes, and host devices of each, which JAX sets up one by one.
_MOST = 256
_VARIED = ("method", "order", "swap")


@click.command("evaluate")
@click.argument("scene", metavar="SCENE")
@click.option(
    "--methods",
    help=f"Names, separated by commas: {', '.join(filters.methods())}; `jaxpf track --help` says "
    "what they are.  [default: sir, ps, dps and sps, as far as they suit the scene; sir alone for "
    "one object]",
)
@click.option(
    "--orders",
    multiple=True,
    default=["shifts"],
    show_default=True,
    help="For ps: 'shifts', every circular shift on its own, or the objects by their place from "
    "1, such as 3,1,2; repeat it for several orders.",
)
@click.option(
    "--swaps",
    default="combinatorial",
    show_default=True,
    help="For sps: how objects change places.",
)
@declared_options(grid=True, without=_VARIED)
@click.option(
    "--target", help=f"What the objects are: {', '.join(targets())}.  [default: by the scene]"
)
@click.option("--runs", default=50, show_default=True, help="Runs per configuration.")
@click.option("--seed", default=0, show_default=True, help="Seed of all runs.")
@click.option("--scene-seed", default=0, show_default=True, help="Seed of a synthetic scene.")
@click.option(
    "--set",
    "parameters",
    multiple=True,
    metavar="NAME=VALUE",
    help="A parameter of a synthetic scene, such as lead_distance=60; repeat it.",
)
@click.option(
    "--ids",
    type=common.NumberList(int),
    help="Objects of a folder's truth, such as 1,2,5.  [default: all in the start frame]",
)
@click.option(
    "--start-frame",
    type=int,
    help="Of a folder, from 0.  [default: the first with all objects]",
)
@click.option("--frames", type=int, help="Of a folder: how many, the start frame included.")
@click.option(
    "--tracks",
    multiple=True,
    metavar="NAME=FILE",
    help="Another tracker's results, in MOT format or with the header frame,id,x,y,w,h; repeat it.",
)
@click.option(
    "--tracker",
    "trackers",
    multiple=True,
    metavar="[NAME=]FILE.py:FUNCTION",
    help="A tracker of your own, a function of the scene that returns a tracker or boxes "
    "[T, P, 4]; repeat it.",
)
@click.option(
    "--baseline",
    "baselines",
    multiple=True,
    help="What people would use instead, beside the methods: mil (OpenCV's), csrt, kcf (where "
    "opencv-contrib is installed), meanshift, still (boxes that never move); several with commas.",
)
@click.option("--workers", default=1, show_default=True, help="Processes that share the work.")
@click.option(
    "--devices",
    type=int,
    help="Host devices per process over which runs are spread.  [default: all cores, shared out]",
)
@click.option(
    "--memory", default=256, show_default=True, help="Megabytes that a batch of runs may take."
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Folder for the results, which a second call continues.  [default: jaxpf-NAME]",
)
@click.option("--dry-run", is_flag=True, help="Show the plan only.")
@common.config_option()
def command(**options: Any) -> None:
    """Compare methods on SCENE over many runs, with intervals, and write tables and a report.

    SCENE is the name of a synthetic scene, such as distracter, a folder with a sequence and
    its truth (video or frames with gt.csv and meta.json; a MOTChallenge or an OTB sequence),
    or a function that makes a scene, file.py:function.  Every method is run with every value of
    every option that it has, such as --sharpness, --particles and --scale; lists are separated
    by commas.

    Runs are kept batch by batch.  The same command continues what was interrupted, more --runs
    are added to those there are, and a second call on a finished evaluation does nothing.  The
    results of a seed do not depend on --workers, --devices or --memory.

    Example: jaxpf evaluate distracter --sharpness 20,30,40,50 --scale 2,2,0.001
    """
    from jaxpf.cli import evaluation_output
    from jaxpf.evaluation import Limits, finished, prepare

    _check(options)
    output = options["output"] or Path(f"jaxpf-{common.scene_name(options['scene'])}")
    plan = _plan(options)
    results = finished(plan, output)
    if results is not None and options["dry_run"]:
        click.echo(f"{output}/: finished, nothing left to do")
        return
    if results is not None and evaluation_output.print_again(output, plan.runs):
        return
    common.start_jax(options["devices"])
    if results is None:
        limits = Limits(
            memory=options["memory"] * 2**20,
            workers=options["workers"],
            devices=options["devices"],
        )
        if options["baselines"]:
            click.echo(f"Baselines come first: {', '.join(options['baselines'])}", err=True)
        prepared = prepare(plan, output, limits)
        evaluation_output.show_plan(prepared, options["workers"], options["devices"])
        check_memory(
            options["workers"] * prepared.memory,
            "ask for fewer particles, workers or frames, or a smaller --memory",
        )
        if options["dry_run"]:
            return
        results = _carry_out(prepared, options)
    _finish(results, options)


def _check(options: dict[str, Any]) -> None:
    """Refuse what is no matter of the library, and complete what was left open."""
    from jaxpf.evaluation.execution import num_cores

    for name, most in (("workers", _MOST), ("devices", _MOST), ("memory", 2**30)):
        if options[name] is not None and not 1 <= options[name] <= most:
            raise InputError(f"--{name} {options[name]} must be from 1 to {most}.")
    options["scene"] = common.resolved_scene(options["scene"])
    options["tracks"] = [
        f"{name}={path}" for name, path in (_pair("--tracks", t, _full) for t in options["tracks"])
    ]
    options["trackers"] = [f"{name}={place}" for name, place in map(_own, options["trackers"])]
    named = [name for text in options["baselines"] for name in common.names_in(text)]
    options["baselines"] = list(dict.fromkeys(named))
    options["devices"] = options["devices"] or max(1, num_cores() // options["workers"])


def _plan(options: dict[str, Any]) -> Any:
    """The library's plan for what was typed."""
    from jaxpf.evaluation import Plan
    from jaxpf.evaluation.baselines import baselines
    from jaxpf.experiments.sources import OwnTracker, load_scene

    parameters = dict(_pair("--set", text, _value) for text in options["parameters"])
    tracks = dict(_pair("--tracks", text, str) for text in options["tracks"])
    trackers = dict(_pair("--tracker", text, OwnTracker) for text in options["trackers"])
    for flag, given in (("tracks", tracks), ("tracker", trackers)):
        if len(given) < len(options[{"tracker": "trackers"}.get(flag, flag)]):
            raise InputError(f"--{flag} gives a name twice; give each file a name of its own.")
    theirs = baselines(options["baselines"])
    for name in theirs.keys() & trackers.keys():
        raise InputError(f"--tracker {name!r} is the name of a baseline; give it another one.")
    return Plan(
        scene=functools.partial(
            load_scene,
            source=options["scene"],
            seed=options["scene_seed"],
            ids=options["ids"],
            start_frame=options["start_frame"],
            num_frames=options["frames"],
            parameters=parameters,
        ),
        methods=None if options["methods"] is None else common.names_in(options["methods"]),
        orders=[_order(text) for text in options["orders"]],
        swaps=common.names_in(options["swaps"]),
        grid=_grid(options),
        target=options["target"],
        runs=options["runs"],
        seed=options["seed"],
        tracks=tracks,
        trackers=trackers | theirs,
    )


def _grid(options: dict[str, Any]) -> dict[str, Any]:
    """The values of declared options that were given."""
    given: dict[str, Any] = {}
    for name, one in all_options(_VARIED).items():
        value = options[name]
        if value not in (None, ()):
            if isinstance(value, bool):
                value = [value]
            given[name] = common.names_in(value) if isinstance(value, str) else list(value)
            if one.length:
                given[name] = [tuple(entry) for entry in value]
    return given


def _order(text: str) -> Any:
    """Places from 1, as people count them, to places from 0."""
    if text == "shifts":
        return text
    entries = text.split(",")
    if not all(entry.strip().isdecimal() and int(entry) > 0 for entry in entries):
        raise InputError(
            f"--orders {text!r} is no order; write 'shifts', or the objects by their place from 1, "
            "such as 3,1,2."
        )
    return tuple(int(entry) - 1 for entry in entries)


def _own(text: str) -> tuple[str, str]:
    """Name and full place of a tracker; without a name, its function's."""
    name, equals, place = text.partition("=")
    if not equals:
        name, place = text.rpartition(":")[2], text
    path, colon, function = place.rpartition(":")
    return name, f"{Path(path).resolve()}:{function}" if colon else place


def _pair(option: str, text: str, convert: Any) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (equals and name.strip() and value.strip()):
        raise InputError(f"{option} {text!r} must have the form NAME=VALUE.")
    return name.strip(), convert(value.strip())


def _full(path: str) -> str:
    return str(Path(path).resolve())


def _value(text: str) -> Any:
    """A number, true, false or none; any other text is itself."""
    if text.lower() in ("none", "null"):
        return None
    try:
        return json.loads(text.lower() if text.lower() in ("true", "false") else text)
    except ValueError:
        return text


def _carry_out(prepared: Any, options: dict[str, Any]) -> Any:
    """Do what is missing behind a progress bar; an interruption says how to go on."""
    from jaxpf.cli.evaluation_output import FINISHED
    from jaxpf.evaluation import carry_out, local_pool
    from jaxpf.evaluation.speed import measure_speeds

    (prepared.folder / FINISHED).unlink(missing_ok=True)  # it tells of fewer runs
    executor = None
    if options["workers"] > 1:
        executor = local_pool(options["workers"], options["devices"], common.use_compile_cache)
    try:
        with common.progress_bar("runs") as bar:
            task = bar.add_task(prepared.settings["scene"]["name"], total=prepared.missing_runs)
            results = carry_out(
                prepared, executor=executor, progress=lambda runs: bar.advance(task, runs)
            )
        measure_speeds(
            prepared,
            results,
            lambda label: click.echo(f"Timing one run alone: {label}", err=True),
        )
        return results
    except KeyboardInterrupt:
        click.echo(
            f"Finished runs are kept in '{prepared.folder}'; the same command continues.", err=True
        )
        raise


def _finish(results: Any, options: dict[str, Any]) -> None:
    """Tables, report, and the file that repeats the evaluation; then say what was found."""
    from jaxpf.cli.evaluation_output import print_results
    from jaxpf.evaluation.report import write_report
    from jaxpf.evaluation.tables import write_tables

    # In the order of the help: the same evaluation writes the same file, however it was typed.
    names = [str(param.name) for param in click.get_current_context().command.params]
    repeated = {
        name: options[name]
        for name in names
        if name not in _NOT_REPEATED and options[name] not in (None, ())
    }
    common.write_config(results.folder / "run.toml", "evaluate", repeated)
    tables = write_tables(results)
    write_report(results, tables)
    print_results(results, tables)
