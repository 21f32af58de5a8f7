"""``jaxpf reproduce``: a paper's experiment, published and measured side by side."""

import math
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf.cli.evaluating.cluster import cluster
from jaxpf.cli.shared.config import config_option, write_config
from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.speaking import Speaking
from jaxpf.cli.shared.startup import start_jax

#: Folder of what the looks measured, and the time that they may take.
LOOKS, MINUTES = "looks", 35.0
#: As ``jaxpf.papers.paper.PAPERS``, without importing it.
PAPERS = ("smith2004", "gonzales2011", "rowe2005", "eskil2014", "maccormick1999")


@click.command("reproduce", cls=Speaking)
@click.argument("paper", type=click.Choice(PAPERS))
@click.option("--runs", type=int, help="Independent runs per cell.  [default: as in the paper]")
@click.option("--seed", default=0, show_default=True, help="First seed of the scenes and runs.")
@click.option("--quick", is_flag=True, help="A much smaller version, to see what it does.")
@click.option(
    "--until-resolved",
    is_flag=True,
    help="Twice the runs, again and again, until every claim is resolved or the time is over; the "
    "same command goes on.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0, min_open=True),
    help="With --until-resolved: begin no look that would end later.  [default: 35]",
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
    help="The address of a Dask scheduler whose workers share the runs, such as "
    "tcp://127.0.0.1:8786; what is timed is timed here.",
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
    contradicted, equal within a stated margin, or cannot be resolved at this number of runs.
    Interrupted, it goes on where it was by the same command.
    """
    from jaxpf.contract.errors import InputError
    from jaxpf.files.writing import prepare_output_folder

    if runs is not None and runs < 1:
        raise InputError(f"--runs {runs} must be at least 1.")
    if not 0 <= seed < 2**20:
        raise InputError(f"--seed {seed} must be between 0 and {2**20 - 1}.")
    if until_resolved and (runs is not None or quick or calibrate):
        raise InputError(
            "--until-resolved begins with the paper's own number of runs; leave out --runs, "
            "--quick and --calibrate."
        )
    if minutes is not None and math.isnan(minutes):
        raise InputError("--minutes nan must be a number above 0.")
    if minutes is not None and not until_resolved:
        raise InputError("--minutes is about --until-resolved, which was not given.")
    data = _data_folder(data)
    options = {"paper": paper, "runs": runs, "seed": seed, "quick": quick, "data": data}
    settings = options | {"data": data and str(data.resolve())}
    start_jax()
    from jaxpf.papers.judging import comparison_table
    from jaxpf.papers.judging.claims import RULE
    from jaxpf.papers.measuring import checkpoints
    from jaxpf.papers.paper import paper_of, until_resolved as look_until_resolved

    began = time.perf_counter()
    one = paper_of(paper)
    if calibrate and one.calibrate is None:
        raise InputError(f"--calibrate: {paper} has nothing to calibrate; leave it out.")
    if calibrate and dask:
        raise InputError("--calibrate searches on this machine alone; leave --dask out.")
    # A mistake is told before the folder is made.
    request = one.request(runs, seed, quick, data, click.echo)
    executor = None
    if dask:
        executor = click.get_current_context().with_resource(cluster(dask)).executor
    output = output or Path(f"jaxpf-{paper}-quick" if quick else f"jaxpf-{paper}")
    kept = output / LOOKS if until_resolved else output, settings
    goes_on = not calibrate and checkpoints.can_go_on(*kept)
    folder = prepare_output_folder(output, overwrite or goes_on)
    if one.calibrate is not None and calibrate:
        _show_calibration(one.calibrate(click.echo, data), folder)
        return
    if goes_on:
        click.echo(f"Going on with what '{folder}' holds.")
    looks = {"until_resolved": True, "minutes": minutes} if until_resolved else {}
    typed = _typed(options | looks)
    with checkpoints.sharing(executor), checkpoints.keeping(*kept, for_good=until_resolved):
        found = (
            look_until_resolved(one, request, minutes or MINUTES)
            if until_resolved
            else iter([one.compare(request)])
        )
        for comparison in found:
            written = comparison_table.write(comparison, folder, typed)
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
    write_config(folder / "run.toml", "reproduce", options | looks)
    seconds = time.perf_counter() - began
    click.echo(f"{folder}/: {', '.join([*written, 'run.toml'])} ({seconds:.0f} s)")


def _typed(options: Mapping[str, Any]) -> str:
    """The command in words; a folder of clips by its name alone, wherever it lies."""
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


def _show_calibration(table: Any, folder: Path) -> None:
    from jaxpf.files.writing import write_text
    from jaxpf.papers.judging.comparison_table import table_csv

    print_table(table.title, table.columns, table.texts())
    click.echo(table.note)
    write_text(folder / f"{table.name}.csv", table_csv(table))
    click.echo(f"{folder}/: {table.name}.csv")


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
            f"{place} names '{folder}', which is no folder; name one that holds real clips, such "
            "as tud_campus, or leave it out."
        )
    return folder
