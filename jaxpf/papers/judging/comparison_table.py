"""The result of repeating a paper: published and measured figures, judged claims, plots.

A ``Comparison`` is written as Markdown, CSV and PNG.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jaxpf import __version__
from jaxpf.files.tables import Table, markdown_table
from jaxpf.files.writing import csv_text, write_text
from jaxpf.papers.judging.claims import GROUPS, RULE, Judged
from jaxpf.papers.judging.verdicts import csv_of
from jaxpf.papers.tables import table_rows


class Comparison(NamedTuple):
    """Published and measured figures of a paper.

    Attributes:
        paper: key of the paper, such as "smith2004".
        title: one line.
        tables: in display order.
        claims: with their verdicts.
        figures: file-name stem -> matplotlib figure.
        notes: sentences on the method and its limits.
    """

    paper: str
    title: str
    tables: Sequence[Table]
    claims: Sequence[Judged]
    figures: Mapping[str, Any]
    notes: Sequence[str]


#: How to read the tables.
CELLS = (
    "Cells read: published | measured [95% interval].  Too few scenes have no interval: shares "
    "below three, means of unbounded values below 25."
)


def markdown(comparison: Comparison) -> str:
    """The whole comparison as one Markdown text; figures are linked by file name."""
    lines = [f"# {comparison.title}", "", CELLS, ""]
    for table in comparison.tables:
        lines += [f"## {table.title}", "", *markdown_table(table.columns, table.texts()), ""]
        if table.note:
            lines += [table.note, ""]
    lines += ["## Claims", "", RULE, "", *claims_markdown(comparison.claims)]
    for stem in comparison.figures:
        lines += [f"![{stem}]({stem}.png)", ""]
    return "\n".join([*lines, "## Notes", "", *(f"- {note}" for note in comparison.notes), ""])


def claims_markdown(claims: Sequence[Judged], level: int = 3) -> list[str]:
    """A table of claims for every group, under a heading of the given level, as Markdown lines."""
    lines = []
    for group, title in GROUPS.items():
        rows = [
            [claim.sentence, claim.source, claim.published, each.shown, each.verdict]
            for each in claims
            if (claim := each.claim).group == group
        ]
        if rows:
            columns = ("claim", "source", "published", "ours", "verdict")
            lines += [f"{'#' * level} {title.capitalize()}", "", *markdown_table(columns, rows), ""]
    return lines


def write(comparison: Comparison, folder: Path, command: str = "") -> list[str]:
    """Write ``PAPER.md``, ``verdicts.csv``, a CSV per table and the figures.

    Args:
        comparison: what to write.
        folder: existing output folder.
        command: repeats the measurement; stored in ``verdicts.csv`` with the version.

    Returns:
        The names of the files, in the order written.

    Raises:
        InputError: a file cannot be written.
    """
    from jaxpf.media import plotting

    written = []

    def text(name: str, content: str) -> None:
        write_text(folder / name, content)
        written.append(name)

    for table in comparison.tables:
        text(f"{table.name}.csv", csv_text(table_rows(table)))
    judged = (each._replace(command=command, version=__version__) for each in comparison.claims)
    text("verdicts.csv", csv_of(judged))
    for stem, figure in comparison.figures.items():
        plotting.save_figure(figure, folder / f"{stem}.png")
        written.append(f"{stem}.png")
    text(f"{comparison.paper}.md", markdown(comparison))
    return written
