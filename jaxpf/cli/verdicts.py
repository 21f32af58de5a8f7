"""``jaxpf verdicts``: the stored verdicts on the papers' claims."""

import textwrap
from pathlib import Path

import click

from jaxpf.cli.shared import flags
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import Command
from jaxpf.files.writing import report_os_errors, write_text
from jaxpf.papers import PAPERS
from jaxpf.papers.judging import verdicts
from jaxpf.papers.judging.claims import RULE


@click.command("verdicts", cls=Command)
@click.argument("papers", nargs=-1, type=click.Choice(PAPERS), metavar="[PAPER]...")
@flags.output(
    "Folder that also gets the verdicts as PAPER/verdicts.csv, judged again by today's rule.  "
    "[default: none]"
)
@click.option(
    "--details",
    is_flag=True,
    help="Print the sentence behind each line, and claims of other kinds: corrected methods, "
    "events seen once, beyond the papers, not judged, measured earlier.",
)
def command(papers: tuple[str, ...], output: Path | None, details: bool) -> None:
    """Print the claims of the papers with their stored verdicts.

    Nothing is run; `jaxpf reproduce PAPER` measures a paper again.
    PAPER is one of smith2004, gonzales2011, rowe2005, eskil2014, maccormick1999; all by default.
    """
    for paper in papers or PAPERS:
        judged = verdicts.stored(paper)
        if output is not None:
            judged = [verdicts.judged_again(each) for each in judged]
            with report_os_errors("create the folder", output / paper):
                (output / paper).mkdir(parents=True, exist_ok=True)
            write_text(output / paper / "verdicts.csv", verdicts.csv_of(judged))
        for line in verdicts.report(paper, judged, details):
            say(line)
        say()
    say(textwrap.fill(RULE, 100))
