"""``jaxpf verdicts``: what was found of the papers' claims."""

import click

from jaxpf.cli.reproduce import PAPERS
from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.speaking import Speaking


@click.command("verdicts", cls=Speaking)
@click.argument("papers", nargs=-1, type=click.Choice(PAPERS), metavar="[PAPER]...")
def command(papers: tuple[str, ...]) -> None:
    """Print every claim of the papers with its stored verdict, then those that have none.

    Nothing is run: `jaxpf reproduce PAPER` does, with the command that is printed under each table.
    PAPER is one of smith2004, gonzales2011, rowe2005, eskil2014, maccormick1999; all by default.
    """
    from jaxpf.papers.judging import verdicts
    from jaxpf.papers.judging.claims import RULE
    from jaxpf.papers.judging.comparison_table import CLAIM_COLUMNS, CLAIM_FIELDS

    papers = papers or PAPERS
    for paper in papers:
        if claims := verdicts.stored(paper):
            rows = [[claim[field] for field in CLAIM_FIELDS] for claim in claims]
            print_table(paper, CLAIM_COLUMNS, rows)
            click.echo(f"{claims[0]['command']}: {verdicts.origin(claims[0])}")
        if left := verdicts.not_judged(paper):
            click.echo("Not judged:")
            for each in left:
                click.echo(f"- {each['claim']} ({each['source']}): {each['reason']}")
        click.echo()
    print_table("Claims", *verdicts.overview(papers))
    click.echo(RULE)
