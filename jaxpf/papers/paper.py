"""The framework shared by all papers.

Each paper has a folder with the same files: ``published`` (its figures, as data), ``scenes`` (drawn
scenes, and the runs on them), ``measures`` (by the names in ``claims.csv``), ``tables``,
``figures``, ``claims.csv``, ``settings.csv`` (settings that the paper leaves open, and how they
were chosen) and ``__init__`` with the ``PAPER``.
"""

import dataclasses
import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jaxpf.files.tables import Table
from jaxpf.papers.judging.claims import Judged, Quantity, judge_all, read_rows
from jaxpf.papers.judging.comparison_table import Comparison
from jaxpf.papers.judging.verdicts import judged_again, stored

#: Papers that can be repeated; each is a module here with a ``PAPER``.
PAPERS = ("smith2004", "gonzales2011", "rowe2005", "eskil2014", "maccormick1999")


def paper_of(name: str) -> "Paper":
    """Import the paper of a name."""
    return importlib.import_module(f"jaxpf.papers.{name}").PAPER


@dataclasses.dataclass(frozen=True)
class Request:
    """The part of a paper to repeat.

    Attributes:
        seeds: seeds of the scenes.
        quick: measure much less, as a preview.
        report: receives lines of progress.
    """

    seeds: range
    quick: bool
    report: Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Paper:
    """Describes how to repeat a paper.

    Attributes:
        name: such as "smith2004".
        title: one line.
        scenes: planned number of scenes, over which intervals are computed; they are evaluated
            once.
        measure: runs all measurements for tables, claims and figures.
        tables: tables of the measurements, in display order.
        quantities: key of a claim -> the figures that judge it.
        figures: file-name stem -> matplotlib figure.
        notes: sentences on the method and its limits.
        computed: those of ``quantities`` that are computed without a measurement.
        quick_scenes: number of scenes in the quick version.
    """

    name: str
    title: str
    scenes: int
    measure: Callable[[Request], Any]
    tables: Callable[[Any], Sequence[Table]]
    quantities: Callable[[Any], Mapping[str, Sequence[Quantity]]]
    figures: Callable[[Any], Mapping[str, Any]]
    notes: Sequence[str]
    computed: Callable[[], Mapping[str, Sequence[Quantity]]] = dict
    quick_scenes: int = 2

    def request(
        self,
        scenes: int | None = None,
        seed: int = 0,
        quick: bool = False,
        report: Callable[[str], None] = print,
    ) -> Request:
        """Choose the number of scenes.

        Args:
            scenes: number of scenes; default the planned number, or ``quick_scenes``.
            seed: seed of the first scene.
            quick: a much smaller version, as a preview.
            report: receives lines of progress.
        """
        if scenes is None:
            scenes = self.quick_scenes if quick else self.scenes
        return Request(range(seed, seed + scenes), quick, report)

    def compare(self, request: Request) -> Comparison:
        """Run the measurements and compare them with the published figures."""
        measured = self.measure(request)
        return Comparison(
            paper=self.name,
            title=self.title,
            tables=[*self.tables(measured), *settings_tables(self.name)],
            claims=judge_all(self.name, {**self.quantities(measured), **self.computed()}),
            figures=self.figures(measured),
            notes=self.notes,
        )

    def judge_again(self) -> list[Judged]:
        """The stored figures, judged by today's claims; computed figures are computed again."""
        computed = {each.claim.key: each for each in judge_all(self.name, self.computed())}
        again = []
        for each in stored(self.name):
            if (new := computed.get(each.claim.key)) is not None:
                again.append(new._replace(command=each.command, version=each.version))
            else:
                again.append(judged_again(each))
        return again

    def run(self, **asked: Any) -> Comparison:
        """``request`` and ``compare`` in one call."""
        return self.compare(self.request(**asked))


def settings_tables(paper: str) -> list[Table]:
    """The paper's ``settings.csv`` as a table; an empty list if it does not exist."""
    settings = read_rows(paper, "settings.csv")
    rows = [(row["setting"], [row["value"], row["how"]]) for row in settings]
    title = "Settings that the paper leaves open, chosen on scenes that no report uses"
    columns = ["setting", "value", "how it was chosen"]
    return [Table("chosen_settings", title, columns, rows)] if rows else []
