"""``jaxpf evaluate``: compare methods, orderings and parameters on a scene over many runs.

A request is parsed, prepared, run and finished; of a folder of sequences, one after another.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import pandas as pd

from jaxpf.cli.evaluating.request import VARIED, Compared, Request, Work, parse
from jaxpf.cli.shared.console import print_table, progress_bar, say
from jaxpf.cli.shared.flags import write_config
from jaxpf.cli.shared.scene_options import SceneCommand, SceneOptions
from jaxpf.cli.shared.startup import cluster, start_jax, use_compile_cache
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import applying, options_of
from jaxpf.evaluation import overall, report, tables
from jaxpf.evaluation.engine import Pool, Prepared, carry_out, local_pool, prepare
from jaxpf.evaluation.results import Results
from jaxpf.evaluation.scene import start_frame
from jaxpf.evaluation.speed import measure_speeds
from jaxpf.files.store import LOCK, locked
from jaxpf.files.writing import check_output_folder
from jaxpf.sequences import open_sequence
from jaxpf.sequences.layouts import sequences_in
from jaxpf.targets.registry import target_of_scene

#: Output files that the last line lists.
_WRITTEN = ("report.html", "results.csv", "summary.csv", "curves.csv", "run.toml")
#: Options that apply to a single sequence only.
_OF_ONE = ("ids", "start_frame", "tracks")


def _command(**values: Any) -> None:
    request = parse(values)
    if sequences := sequences_in(request.scene):
        _evaluate_each(request, sequences)
    else:
        _evaluate(request)


def _evaluate_each(request: Request, folders: Sequence[Path]) -> None:
    """Evaluate sequences one after another, then print results over all of them.

    Raises:
        InputError: an option applies to a single sequence only, or fewer than two sequences are of
            one kind.
    """
    options, output = request.options, request.output
    for name in _OF_ONE:
        if getattr(options, name):
            flag = f"--{name.replace('_', '-')}"
            raise InputError(f"{flag} works only for a single sequence; leave it out, or name one.")
    kind, chosen = _of_one_kind(folders, options.target, options.frames)
    if len(chosen) < 2:
        raise InputError(
            f"'{request.scene}' holds {len(chosen)} sequence(s) that can be evaluated together; "
            "give at least 2, or name one of them."
        )
    for number, (folder, frames) in enumerate(chosen.items(), start=1):
        say(f"\n{folder.name} ({number} of {len(chosen)})")
        _evaluate(request.of_sequence(folder, kind, frames))
    if options.dry_run:
        return
    say()
    names = [folder.name for folder in chosen]
    _print_tables(overall.write_overall(output, names, request.varied))
    write_config(output / "run.toml", "evaluate", request.table())
    say(overall.about_units(len(chosen)))
    say(f"{output}/: {', '.join(overall.FILES)}, run.toml, and a folder for each sequence")


def _of_one_kind(
    folders: Sequence[Path], kind: str | None, most: int | None
) -> tuple[str | None, dict[Path, int | None]]:
    """Select sequences with a given kind of truth (default: the first's) and at most N frames.

    Prints which sequences are left out.
    """
    chosen: dict[Path, int | None] = {}
    for folder in folders:
        try:
            sequence = open_sequence(folder)
            scene = sequence.scene(num_frames=2)
            kind = target_of_scene(scene, kind).name
        except InputError as error:
            say(f"{folder.name} is left out: {error}", err=True)
            continue
        available = sequence.num_frames - start_frame(scene)
        chosen[folder] = None if most is None else min(most, available)
    return kind, chosen


def _evaluate(request: Request) -> None:
    """Evaluate one scene, and write and print its tables; only the plan with ``--dry-run``.

    Raises:
        InputError: no scheduler answers, or the scene cannot be opened.
    """
    options, output, pool = request.options, request.output, None
    check_output_folder(output)
    if (output / LOCK).exists():  # fail early: planning takes minutes
        with locked(output, "evaluating"):
            pass
    devices = start_jax(options.devices, options.workers)
    if options.dask:
        pool = click.get_current_context().with_resource(cluster(options.dask, options.devices))
    elif options.workers > 1:
        pool = local_pool(options.workers, devices, use_compile_cache)
    workers = pool.workers if pool else 1
    say(f"Reading {request.scene}", err=True)
    if options.baseline:
        say(f"Baselines come first: {', '.join(options.baseline)}", err=True)
    prepared = prepare(request.plan, output, workers)
    if prepared.missing_runs:
        _show_plan(prepared, workers, devices)
    elif options.dry_run:
        say(f"{output}/: finished, nothing left to do")
    if options.dry_run:
        return
    results = _run(request, prepared, pool)
    write_config(output / "run.toml", "evaluate", request.table())
    overview = tables.write_tables(results)
    report.write_report(overview)
    _print_tables(tables.printed_tables(overview))
    for remark in overview.remarks:
        say(remark)
    say(f"{output}/: {', '.join(_WRITTEN)}")
    say(overview.conclusion)


def _run(request: Request, prepared: Prepared, pool: Pool | None) -> Results:
    """Run the missing work behind a progress bar, then measure speeds.

    An interruption keeps the finished runs and says how to resume.
    """
    try:
        with progress_bar("runs") as bar:
            name = prepared.results.scene_name
            task = bar.add_task(f"{name}: compiling", total=prepared.missing_runs)

            def progress(runs: int) -> None:
                bar.update(task, advance=runs, description=name)

            results = carry_out(prepared, pool=pool, progress=progress)
    except KeyboardInterrupt:
        say(f"Finished runs are kept in '{request.output}'; the same command continues.", err=True)
        raise
    if request.options.speed:

        def announce(label: str) -> None:
            say(f"Timing one run alone: {label}", err=True)

        measure_speeds(results, request.plan, announce)
    return results


def _print_tables(printed: dict[str, pd.DataFrame]) -> None:
    for title, table in printed.items():
        print_table(title, [*table.columns], table.to_numpy().tolist())


def _show_plan(prepared: Prepared, workers: int, devices: int) -> None:
    """Print what is compared, and its cost."""
    results, scene = prepared.results, prepared.results.settings["scene"]
    count, frames = len(scene["object_ids"]), len(results.truth)
    say(
        f"{scene['name']}: {count} object{'s' if count != 1 else ''}, {frames} frames "
        f"after the start frame {scene['start_frame']}, {scene['width']} x {scene['height']} pixels"
    )
    columns, rows, common_to_all = _plan_table(prepared)
    print_table("Plan", columns, rows)
    if common_to_all:
        say(", ".join(f"{name} {value}" for name, value in common_to_all.items()))
    if prepared.damaged:
        say(f"{len(prepared.damaged)} damaged file(s) will be made again.")
    place = f"on {devices} device{'s' if devices > 1 else ''}"
    if workers > 1:
        place = f"in each of {workers} processes {place}"
    say(f"{prepared.missing_runs} runs to do {place}")


def _plan_table(prepared: Prepared) -> tuple[list[str], list[list[str]], dict[str, str]]:
    """A row per method, and the parameters that all configurations share."""
    of, configurations = prepared.results.target, prepared.results.configurations
    by_method: dict[str, list[int]] = {}
    values: dict[str, dict[str, None]] = {}
    for index, configuration in enumerate(configurations):
        by_method.setdefault(configuration.method, []).append(index)
        left_out = options_of(of.tracker).keys() - applying(configuration.parameters, of.tracker)
        for name, value in configuration.parameters.items():
            if name not in left_out:
                values.setdefault(name, {})[plain(value)] = None
    varied = [name for name, texts in values.items() if len(texts) > 1]
    rows = []
    for method, indices in by_method.items():
        group = [configurations[index] for index in indices]
        orderings = " ".join(dict.fromkeys(c.ordering for c in group))
        cells = [" ".join(values[name]) if name in group[0].parameters else "" for name in varied]
        runs = 1 if group[0].is_imported else prepared.results.runs
        done = sum(int(prepared.done[index].sum()) for index in indices)
        rows.append([method, orderings, *cells, f"{len(group)} x {runs}", str(done)])
    common_to_all = {name: next(iter(values[name])) for name in values if name not in varied}
    common_to_all = {n: value for n, value in common_to_all.items() if value != plain(None)}
    return ["method", "ordering", *varied, "runs", "done"], rows, common_to_all


command = SceneCommand(
    "evaluate",
    {"Scene": SceneOptions, "What is compared": Compared, "Runs and work": Work},
    _command,
    grid=True,
    without=VARIED,
    help="""Compare methods on SCENE over many runs, with intervals, and write tables and a report.

    SCENE is a folder with a sequence and its truth, a folder of such folders, the name of a
    synthetic scene, such as distracter, or a function that makes a scene, file.py:function.
    Comma-separated values of options are all combined.

    The same command resumes after an interruption, or adds runs if --runs is larger.

    Examples: jaxpf evaluate distracter --sharpness 20,30,40,50

    jaxpf evaluate FOLDER --baseline all --speed

    A sequence is a folder with a video or frames, gt.csv and meta.json, or a MOTChallenge
    or OTB sequence.  The sequences of a folder are evaluated one after another.  Tables over all of
    them have intervals over the sequences.

    Runs are stored batch by batch.  The results of a seed depend neither on --workers nor on
    --devices.
    """,
)
