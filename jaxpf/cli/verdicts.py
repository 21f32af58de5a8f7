"""``jaxpf verdicts``: the stored verdicts on the papers' claims."""

import textwrap

import click

from jaxpf.cli.reproduce import PAPERS
from jaxpf.cli.shared.plain import PlainCommand


@click.command("verdicts", cls=PlainCommand)
@click.argument("papers", nargs=-1, type=click.Choice(PAPERS), metavar="[PAPER]...")
@click.option(
    "--details",
    is_flag=True,
    help="Print the sentence behind each line, and claims of other kinds: corrected methods, equal "
    "time, events seen once, beyond the papers, not judged.",
)
def command(papers: tuple[str, ...], details: bool) -> None:
    """Print the claims of the papers with their stored verdicts.

    Nothing is run; `jaxpf reproduce PAPER` measures a paper again.
    PAPER is one of smith2004, gonzales2011, rowe2005, eskil2014, maccormick1999; all by default.
    """
    from jaxpf.papers.judging import verdicts
    from jaxpf.papers.judging.claims import RULE

    for paper in papers or PAPERS:
        for line in verdicts.report(paper, verdicts.stored(paper), details):
            click.echo(line)
        click.echo()
    click.echo(textwrap.fill(RULE, 100))
