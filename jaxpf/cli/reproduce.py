"""``jaxpf reproduce``: a paper's experiment, published and measured side by side."""

import math
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import click

from jaxpf.cli.evaluating.cluster import cluster
from jaxpf.cli.shared.config import config_option, write_config
from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.speaking import Speaking
from jaxpf.cli.shared.startup import start_jax

#: Folder of the interim analyses of --until-resolved, and their time in minutes.
LOOKS, MINUTES = "looks", 35.0
#: As ``jaxpf.papers.paper.PAPERS``, without importing it.
PAPERS = ("smith2004", "gonzales2011", "rowe2005", "eskil2014", "maccormick1999")


@click.command("reproduce", cls=Speaking)
@click.argument("paper", type=click.Choice(PAPERS))
@click.option("--runs", type=int, help="Independent runs per cell.  [default: as in the paper]")
@click.option("--seed", default=0, show_default=True, help="First seed of the scenes and runs.")
@click.option("--quick", is_flag=True, help="Run a much smaller version, to see what it does.")
@click.option(
    "--until-resolved",
    is_flag=True,
    help="Double the runs until every claim is resolved or the time is over; the same command "
    "resumes.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0, min_open=True),
    help="With --until-resolved: start no round that would exceed this limit.  [default: 35]",
)
@click.option(
    "--data",
    type=click.Path(path_type=Path),
    help="Folder with real clips (tud_campus, sleap_fly_pair, badja_bear, worm_crossing, ...).  "
    "[default: the environment's JAXPF_DATA]",
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Folder for tables, figures and report.  [default: jaxpf-PAPER, "
    "with --quick jaxpf-PAPER-quick]",
)
@click.option("--overwrite", is_flag=True, help="Accept an output folder that is not empty.")
@click.option(
    "--calibrate", is_flag=True, help="Repeat the search for unpublished settings instead."
)
@click.option(
    "--dask",
    metavar="ADDRESS",
    help="Address of a Dask scheduler whose workers share the runs, such as "
    "tcp://127.0.0.1:8786; timings are measured on this machine.",
)
@config_option()
def command(
    paper: str,
    runs: int | None,
    seed: int,
    quick: bool,
    until_resolved: bool,
    minutes: float | None,
    data: Path | None,
    output: Path | None,
    overwrite: bool,
    calibrate: bool,
    dask: str | None,
) -> None:
    """Repeat a paper's experiment; print its figures beside ours, and judge its claims.

    Published figures stand left of ours, which have 95 % intervals.  A claim is supported,
    contradicted, equal within a stated margin, or cannot be resolved at this number of runs.  The
    same command resumes an interrupted experiment.
    """
    request = _Request(
        paper=paper,
        runs=runs,
        seed=seed,
        quick=quick,
        data=_data_folder(data),
        minutes=minutes,
        until_resolved=until_resolved,
        calibrate=calibrate,
        output=output or Path(f"jaxpf-{paper}-quick" if quick else f"jaxpf-{paper}"),
        overwrite=overwrite,
        dask=dask,
    )
    _check(request)
    start_jax()
    began = time.perf_counter()
    opened = _open(request)
    if request.calibrate:
        _calibrate(request, opened)
        return
    comparison, written = _run(request, opened)
    _finish(request, comparison, written, time.perf_counter() - began)


class _Request(NamedTuple):
    """What was typed, the folders in full; see the help of each option."""

    paper: str
    runs: int | None
    seed: int
    quick: bool
    data: Path | None
    minutes: float | None
    until_resolved: bool
    calibrate: bool
    output: Path
    overwrite: bool
    dask: str | None

    @property
    def table(self) -> dict[str, Any]:
        """What run.toml holds."""
        kept = ["paper", "runs", "seed", "quick", "data"]
        if self.until_resolved:
            kept += ["until_resolved", "minutes"]
        return {name: getattr(self, name) for name in kept}

    @property
    def checkpoint(self) -> tuple[Path, dict[str, Any]]:
        """The folder that keeps finished parts, and the settings that they belong to."""
        settings = {name: getattr(self, name) for name in ("paper", "runs", "seed", "quick")}
        settings["data"] = self.data and str(self.data.resolve())
        return (self.output / LOOKS if self.until_resolved else self.output), settings


class _Opened(NamedTuple):
    """The paper, its own request, the workers that share runs, and whether the run resumes."""

    paper: Any
    request: Any
    executor: Any
    resumes: bool


def _check(request: _Request) -> None:
    """Refuse values out of range, and options that do not go together."""
    from jaxpf.contract.errors import InputError

    runs, minutes = request.runs, request.minutes
    if runs is not None and runs < 1:
        raise InputError(f"--runs {runs} must be at least 1.")
    if not 0 <= request.seed < 2**20:
        raise InputError(f"--seed {request.seed} must be between 0 and {2**20 - 1}.")
    if request.until_resolved and (runs is not None or request.quick or request.calibrate):
        raise InputError(
            "--until-resolved begins with the paper's own number of runs; leave out --runs, "
            "--quick and --calibrate."
        )
    if minutes is not None and math.isnan(minutes):
        raise InputError("--minutes nan must be a number above 0.")
    if minutes is not None and not request.until_resolved:
        raise InputError("--minutes works only with --until-resolved; leave it out, or add that.")
    if request.calibrate and request.dask:
        raise InputError("--calibrate searches on this machine alone; leave --dask out.")


def _open(request: _Request) -> _Opened:
    """Load the paper, check the request against it, connect the workers, prepare the folder."""
    from jaxpf.contract.errors import InputError
    from jaxpf.files.writing import prepare_output_folder
    from jaxpf.papers.measuring import checkpoints
    from jaxpf.papers.paper import paper_of

    paper = paper_of(request.paper)
    if request.calibrate and paper.calibrate is None:
        raise InputError(f"--calibrate: {request.paper} has nothing to calibrate; leave it out.")
    of_paper = paper.request(request.runs, request.seed, request.quick, request.data, click.echo)
    executor = None
    if request.dask:
        workers = click.get_current_context().with_resource(cluster(request.dask))
        executor = workers.executor
    resumes = not request.calibrate and checkpoints.can_go_on(*request.checkpoint)
    prepare_output_folder(request.output, request.overwrite or resumes)
    return _Opened(paper, of_paper, executor, resumes)


def _run(request: _Request, opened: _Opened) -> tuple[Any, Any]:
    """Measure, and write after every interim analysis; the last comparison and its files."""
    from jaxpf.papers.judging import comparison_table
    from jaxpf.papers.measuring import checkpoints
    from jaxpf.papers.paper import until_resolved

    if opened.resumes:
        click.echo(f"Resuming from what '{request.output}' holds.")
    typed = _typed(request.table)
    keeping = checkpoints.keeping(*request.checkpoint, for_good=request.until_resolved)
    with checkpoints.sharing(opened.executor), keeping:
        if request.until_resolved:
            minutes = request.minutes or MINUTES
            comparisons = until_resolved(opened.paper, opened.request, minutes)
        else:
            comparisons = iter([opened.paper.compare(opened.request)])
        for comparison in comparisons:
            written = comparison_table.write(comparison, request.output, typed)
    return comparison, written


def _finish(request: _Request, comparison: Any, written: Any, seconds: float) -> None:
    """Print tables and claims, and write run.toml."""
    from jaxpf.papers.judging import comparison_table
    from jaxpf.papers.judging.claims import RULE

    for table in comparison.tables:
        print_table(table.title, table.columns, table.texts())
        if table.note:
            click.echo(f"{table.note}\n")
    if comparison.claims:
        print_table(
            "Claims",
            comparison_table.CLAIM_COLUMNS,
            comparison_table.claim_rows(comparison.claims),
        )
        click.echo(RULE)
    for note in comparison.notes:
        click.echo(f"- {note}")
    write_config(request.output / "run.toml", "reproduce", request.table)
    files = ", ".join([*written, "run.toml"])
    click.echo(f"{request.output}/: {files} ({seconds:.0f} s)")


def _typed(options: Mapping[str, Any]) -> str:
    """The command as it is typed; a folder of clips is named without its path."""
    words = [f"jaxpf reproduce {options['paper']}"]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif name == "data" and value is not None:
            words.append(f"{flag} {value.resolve().name}")
        elif name != "paper" and value not in (None, False, 0):
            words.append(f"{flag} {value:g}" if isinstance(value, float) else f"{flag} {value}")
    return " ".join(words)


def _calibrate(request: _Request, opened: _Opened) -> None:
    """Repeat the search for settings that the paper does not publish."""
    from jaxpf.files.writing import write_text
    from jaxpf.papers.judging.comparison_table import table_csv

    table = opened.paper.calibrate(click.echo, request.data)
    print_table(table.title, table.columns, table.texts())
    click.echo(table.note)
    write_text(request.output / f"{table.name}.csv", table_csv(table))
    click.echo(f"{request.output}/: {table.name}.csv")


def _data_folder(given: Path | None) -> Path | None:
    """The folder named by ``--data`` or ``JAXPF_DATA``; None if neither is."""
    from jaxpf.contract.errors import InputError

    from_environment = os.environ.get("JAXPF_DATA", "")
    if given is None and not from_environment:
        return None
    place = "JAXPF_DATA" if given is None else "--data"
    folder = Path(from_environment) if given is None else given
    if not folder.is_dir():
        raise InputError(
            f"{place} names '{folder}', which is no folder; name a folder of clips, such as one "
            "that holds tud_campus, or leave it out."
        )
    return folder
