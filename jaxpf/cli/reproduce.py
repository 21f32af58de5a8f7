"""``jaxpf reproduce``: a paper's experiment, with published and measured figures side by side."""

import textwrap
import time
from pathlib import Path

import click

from jaxpf.cli.shared import flags
from jaxpf.cli.shared.console import print_table, say
from jaxpf.cli.shared.flags import Command, config_flag, write_config
from jaxpf.cli.shared.startup import cluster, start_jax
from jaxpf.files.writing import prepare_output_folder
from jaxpf.papers import PAPERS


@click.command("reproduce", cls=Command, params=[config_flag()])
@click.argument("paper", type=click.Choice(PAPERS), metavar="PAPER")
@flags.whole(
    "--scenes",
    default=None,
    least=1,
    most=10_000,
    help="Number of scenes, the units of the intervals.  [default: the planned number]",
)
@flags.whole("--seed", default=0, most=2**20 - 1, help="Seed of the first scene.")
@click.option("--quick", is_flag=True, help="Measure a much smaller version, as a preview.")
@flags.output(
    "Folder for tables, figures and report.  [default: jaxpf-PAPER, with --quick jaxpf-PAPER-quick]"
)
@click.option("--overwrite", is_flag=True, help="Accept an output folder that is not empty.")
@click.option(
    "--dask",
    metavar="ADDRESS",
    help="Address of a Dask scheduler whose workers share the runs, such as tcp://127.0.0.1:8786.",
)
def command(
    paper: str,
    scenes: int | None,
    seed: int,
    quick: bool,
    output: Path | None,
    overwrite: bool,
    dask: str | None,
) -> None:
    """Repeat a paper's experiment, print its figures beside ours, and judge its claims.

    Published figures stand left of ours, which have 95% intervals.  Every claim gets
    a verdict, such as supported or open; fewer than ten scenes are a preview without one.  After
    an interruption, the same command resumes.

    PAPER is one of smith2004, gonzales2011, rowe2005, eskil2014, maccormick1999.
    """
    start_jax()
    from jaxpf.papers import checkpoints
    from jaxpf.papers.judging import verdicts
    from jaxpf.papers.judging.claims import RULE
    from jaxpf.papers.paper import paper_of

    began = time.perf_counter()
    options = {"paper": paper, "scenes": scenes, "seed": seed, "quick": quick}
    chosen = paper_of(paper)
    seeds = chosen.seeds(scenes, seed, quick)
    pool = click.get_current_context().with_resource(cluster(dask)) if dask else None
    output = output or Path(f"jaxpf-{paper}-quick" if quick else f"jaxpf-{paper}")
    resumes = checkpoints.can_resume(output, options)
    folder = prepare_output_folder(output, overwrite or resumes)
    if resumes:
        say(f"Resuming from '{folder}'.")
    say("The first scenes take longest: their programs are compiled.")
    with checkpoints.keeping(output, options, say, pool) as measurements:
        comparison = chosen.compare(seeds, quick, measurements)
        typed = f"jaxpf reproduce {paper} --scenes {len(seeds)} --seed {seed}"
        written = comparison.write(folder, typed + " --quick" * quick)
        write_config(folder / "run.toml", "reproduce", options)
    for table in comparison.tables:
        print_table(table.title, table.columns, table.texts(), explain=False)
        if table.note:
            say(f"{table.note}\n")
    for line in verdicts.report(paper, comparison.claims, details=True):
        say(line)
    say(f"\n{textwrap.fill(RULE, 100)}")
    for note in comparison.notes:
        say(f"- {note}")
    seconds = time.perf_counter() - began
    say(f"{folder}/: {', '.join([*written, 'run.toml'])} ({seconds:.0f} s)")
