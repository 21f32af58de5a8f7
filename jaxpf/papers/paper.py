"""The framework shared by all papers.

Each paper has a folder with the same files: ``scenes`` (drawn scenes, trackers and their runs),
``study`` (measures of the runs, and figures), and the data.  ``paper.toml`` has the title, the
planned number of scenes, notes, ``measures`` with their kind and digits, and the tables with the
published figures; ``claims.csv`` the claims; ``settings.csv`` the settings that the paper leaves
open, and how they were chosen.  ``study`` has the ``PAPER``.
"""

import dataclasses
import functools
import importlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from jaxpf import __version__
from jaxpf.files.writing import csv_text, write_text
from jaxpf.media import plotting
from jaxpf.papers.checkpoints import UNSTORED, Measurements
from jaxpf.papers.judging import verdicts
from jaxpf.papers.judging.claims import GROUPS, RULE, Judged, claims_of, judge_all, read_rows
from jaxpf.papers.judging.estimates import Quantity
from jaxpf.papers.study import Study, Table, tables

#: How to read the tables.
CELLS = (
    "Cells read: published | measured [95% interval].  Too few scenes have no interval: shares "
    "below three, means of unbounded values below 25."
)


def paper_of(name: str) -> "Paper":
    """Import the paper of a name."""
    return importlib.import_module(f"jaxpf.papers.{name}.study").PAPER


class Comparison(NamedTuple):
    """A repeated paper: published and measured figures, judged claims, plots.

    Attributes:
        paper: key of the paper, such as "smith2004".
        title: one line.
        tables: in display order.
        claims: with their verdicts.
        figures: file-name stem -> figure.
        notes: sentences on the method and its limits.
    """

    paper: str
    title: str
    tables: Sequence[Table]
    claims: Sequence[Judged]
    figures: Mapping[str, Figure]
    notes: Sequence[str]

    def markdown(self) -> str:
        """The whole comparison as one Markdown text; figures are linked by file name."""
        lines = [f"# {self.title}", "", CELLS, ""]
        for table in self.tables:
            lines += [f"## {table.title}", "", *markdown_table(table.columns, table.texts()), ""]
            if table.note:
                lines += [table.note, ""]
        lines += ["## Claims", "", RULE, "", *claims_markdown(self.claims)]
        for stem in self.figures:
            lines += [f"![{stem}]({stem}.png)", ""]
        return "\n".join([*lines, "## Notes", "", *(f"- {note}" for note in self.notes), ""])

    def write(self, folder: Path, command: str = "") -> list[str]:
        """Write ``PAPER.md``, ``verdicts.csv``, a CSV per table and the figures.

        Args:
            folder: existing output folder.
            command: repeats the measurement; stored in ``verdicts.csv`` with the version.

        Returns:
            The names of the files.

        Raises:
            InputError: a file cannot be written.
        """
        judged = (each._replace(command=command, version=__version__) for each in self.claims)
        texts = {f"{table.name}.csv": csv_text(table.lines()) for table in self.tables}
        texts["verdicts.csv"] = verdicts.csv_of(judged)
        pictures = {f"{stem}.png": figure for stem, figure in self.figures.items()}
        for name, text in texts.items():
            write_text(folder / name, text)
        for name, figure in pictures.items():
            plotting.save_figure(figure, folder / name)
        write_text(folder / f"{self.paper}.md", self.markdown())
        return [*texts, *pictures, f"{self.paper}.md"]


@dataclasses.dataclass(frozen=True)
class Paper:
    """Describes how to repeat a paper.

    Attributes:
        name: such as "smith2004".
        measure: runs all measurements for tables, claims and figures, see ``compare``.
        figures: of a study; file-name stem -> matplotlib figure.
        computed: key of a claim -> figures that are computed without a measurement.
    """

    name: str
    measure: Callable[[range, bool, Measurements], Study]
    figures: Callable[[Study], Mapping[str, Figure]]
    computed: Callable[[], Mapping[str, Sequence[Quantity]]] = dict

    @functools.cached_property
    def declared(self) -> dict[str, Any]:
        """What ``paper.toml`` has."""
        path = Path(__file__).parent / self.name / "paper.toml"
        return tomllib.loads(path.read_text(encoding="utf-8"))

    def seeds(self, scenes: int | None = None, seed: int = 0, quick: bool = False) -> range:
        """Seeds of the scenes; by default the planned number of them, or two."""
        return range(seed, seed + (scenes or (2 if quick else self.declared["scenes"])))

    def compare(
        self, seeds: range, quick: bool = False, measurements: Measurements = UNSTORED
    ) -> Comparison:
        """Run the measurements and compare them with the published figures.

        Args:
            seeds: of the scenes, over which intervals are computed.
            quick: measure much less, as a preview.
            measurements: where to store them, and who makes them.
        """
        study = self.measure(seeds, quick, measurements)
        return Comparison(
            paper=self.name,
            title=f"{self.name} repeated: {self.declared['title']}",
            tables=[*self.tables(study), settings_table(self.name)],
            claims=judge_all(self.name, {**self.quantities(study), **self.computed()}),
            figures=self.figures(study),
            notes=self.declared["notes"],
        )

    def tables(self, study: Study) -> list[Table]:
        """Tables of the measurements, in display order."""
        return tables(self.declared, study)

    def quantities(self, study: Study) -> dict[str, list[Quantity]]:
        """Key of a claim -> its figures, for claims whose measure and variants were measured."""
        figures = {}
        for key, claim in claims_of(self.name).items():
            if claim.measure:
                kind = self.declared["measures"][claim.measure].get("kind", "mean")
                figures[key] = study.figures(kind, claim.measure, claim.variant, claim.against)
        return {key: found for key, found in figures.items() if found}


def settings_table(paper: str) -> Table:
    """The paper's ``settings.csv`` as a table."""
    settings = read_rows(paper, "settings.csv")
    rows = [(row["setting"], [row["value"], row["how"]]) for row in settings]
    title = "Settings that the paper leaves open, chosen on scenes that no report uses"
    columns = ["setting", "value", "how it was chosen"]
    return Table("chosen_settings", title, columns, rows)


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


def markdown_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table as Markdown lines."""
    return [_line(columns), "|" + " --- |" * len(columns), *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"
