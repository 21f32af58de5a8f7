"""The framework shared by all papers.

Each paper has a folder with the same files: ``scenes`` (drawn scenes, the runs on them, and their
measures), ``figures``, and the data.  ``paper.toml`` has the title, the planned number of scenes,
notes, ``measures`` with their kind and digits, and the tables with the published figures;
``claims.csv`` the claims; ``settings.csv`` the settings that the paper leaves open, and how they
were chosen.  ``__init__`` has the ``PAPER``.
"""

import dataclasses
import functools
import importlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxpf.files.tables import Table
from jaxpf.papers.judging.claims import claims_of, judge_all, read_rows
from jaxpf.papers.judging.comparison_table import Comparison
from jaxpf.papers.judging.estimates import Quantity
from jaxpf.papers.study import Study
from jaxpf.papers.tables import tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Papers that can be repeated; each is a module here with a ``PAPER``.
PAPERS = ("smith2004", "gonzales2011", "rowe2005", "eskil2014", "maccormick1999")


def paper_of(name: str) -> "Paper":
    """Import the paper of a name."""
    return importlib.import_module(f"jaxpf.papers.{name}").PAPER


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
    measure: Callable[[range, bool, Callable[[str], None]], Study]
    figures: "Callable[[Study], Mapping[str, Figure]]"
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
        self, seeds: range, quick: bool = False, report: Callable[[str], None] = print
    ) -> Comparison:
        """Run the measurements and compare them with the published figures.

        Args:
            seeds: of the scenes, over which intervals are computed.
            quick: measure much less, as a preview.
            report: receives lines of progress.
        """
        study = self.measure(seeds, quick, report)
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
