"""What was measured: values of scenes, from which tables, claims and figures are made.

Tables of published and measured figures are declared in ``paper.toml``.

A table has ``columns``: heading -> name of a measure, or a list of measure, variant and perhaps
the variant to compare with; or a ``measure``, and columns of variants.  Its ``rows`` are variants,
or ``"all"``; without ``rows`` there is a row for each case.  Lists are of names that are headings.
``published`` has the paper's figures by heading: one for each row (nan for none), one for all rows,
or by label.  ``how`` overrides a measure's ``kind`` and ``digits`` by heading; its kinds
``"number"``, ``"count"`` (of scenes) and ``"range"`` (over all cases and scenes) are texts without
an interval.  Title and note may quote ``{scenes}``, ``{sequences}`` (their number) and the study's
words.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.estimates import KINDS, Measured, Quantity

_TEXTS: Mapping[str, Callable[[np.ndarray], str]] = {
    "number": lambda values: f"{values.flat[0]:g}",
    "count": lambda values: f"{values.shape[-1]}",
    "range": lambda values: f"{values.min():.1f} to {values.max():.1f}",
}


#: (measure, variant, case) -> values ``[S]`` by scene; a case is such as a sharpness.
Values = dict[tuple[str, str, str], Any]


class Study(NamedTuple):
    """The measurements of a paper.

    Attributes:
        values: by measure, variant and case; shares are between 0 and 1.  A variant may have the
            first scenes only.
        shown: what the figures show beside.
        words: what the texts of tables quote.
    """

    values: Values
    shown: Any = None
    words: Mapping[str, str] = {}

    def by_case(self, measure: str, variant: str) -> dict[str, np.ndarray]:
        """Case -> values by scene; empty if it was not measured."""
        return {
            case: np.asarray(values, float)
            for (*key, case), values in self.values.items()
            if key == [measure, variant]
        }

    def figures(self, kind: str, measure: str, variant: str, against: str = "") -> list[Quantity]:
        """Of each case, the estimate over scenes, or two variants' on their common scenes.

        Args:
            kind: ``"mean"``, ``"percent"`` of shares, or for positive values that are compared by
                the geometric mean of their ratios ``"ratio"`` (without another variant: to 1) or
                ``"gain"``, one less the ratio in per cent (without another variant: the mean).
            measure: name of the measure.
            variant: whose.
            against: the variant to compare with, or empty.

        Returns:
            An empty list if a variant was not measured.
        """
        estimate, first = KINDS[kind], self.by_case(measure, variant)
        if not against:
            return [estimate(values, what=case) for case, values in first.items()]
        second, figures = self.by_case(measure, against), []
        for case, ours in first.items() if second else ():
            common = min(len(ours), len(second[case]))
            figures.append(estimate(ours[:common], second[case][:common], case))
        return figures

    def variants(self, measure: str) -> list[str]:
        """All variants of which a measure was taken."""
        return list(dict.fromkeys(variant for each, variant, _ in self.values if each == measure))


class Table(NamedTuple):
    """A table.

    Attributes:
        name: stem of its file.
        title: one line above the table, with units.
        columns: header, starting with the label's column.
        rows: ``(label, cells)``; a cell is a text or a ``Cell``.
        note: remark for the reader; may be empty.
    """

    name: str
    title: str
    columns: list[str]
    rows: list[tuple[str, list[Any]]]
    note: str = ""

    def texts(self) -> list[list[str]]:
        """Rows of text for printing."""
        return [[label, *map(str, cells)] for label, cells in self.rows]

    def lines(self) -> Iterator[Sequence[object]]:
        """A line for each cell, with columns for the published and the measured figure."""
        yield "row", "column", "published", "measured", "low", "high", "text"
        for label, cells in self.rows:
            for column, cell in zip(self.columns[1:], cells, strict=True):
                if isinstance(cell, str):
                    yield label, column, "", "", "", "", cell
                    continue
                published = "" if cell.published is None else cell.published
                measured = [f"{x:.6g}" if math.isfinite(x) else "" for x in cell.measured]
                yield label, column, published, *measured, ""


class Cell(NamedTuple):
    """A published and a measured figure.

    Attributes:
        published: the paper's figure, or None.
        measured: ours with its 95% interval.
        digits: decimal places to show.
    """

    published: float | None
    measured: Measured
    digits: int = 0

    def __str__(self) -> str:
        """``published | measured [low, high]``, with a dash for a missing value."""
        left = "–" if self.published is None else f"{self.published:z.{self.digits}f}"
        value, low, high = (f"{x:z.{self.digits}f}" for x in self.measured)
        return f"{left} | {value}" + f" [{low}, {high}]" * (not math.isnan(self.measured.low))


def tables(declared: Mapping[str, Any], study: Study) -> list[Table]:
    """The tables of a paper's ``paper.toml`` whose measures were taken."""
    made = (_table(each, declared["measures"], study) for each in declared["tables"])
    return [table for table in made if table]


def _table(declared: Mapping[str, Any], measures: Mapping[str, Any], study: Study) -> Table | None:
    rows: dict[str, list[Any]] = {}
    number = 0
    columns = named(declared["columns"])
    for heading, column in columns.items():
        column = [column] if isinstance(column, str) else column
        measure, *variants = [declared["measure"], *column] if "measure" in declared else column
        how = {**measures[measure], **declared.get("how", {}).get(heading, {})}
        kind, digits = how.get("kind", "mean"), how.get("digits", 0)
        known = declared.get("published", {}).get(heading)
        for label, *of_row in _labels(declared, measure, study, variants):
            if kind in _TEXTS:
                values = np.array(list(study.by_case(measure, *of_row).values()))
                rows.setdefault(label, []).append(_TEXTS[kind](values))
                continue
            for figure in study.figures(kind, measure, *of_row):
                cells = rows.setdefault(label or figure.what, [])
                printed = _published(known, label, list(rows).index(label or figure.what))
                is_known = not math.isnan(figure.value)
                cells.append(Cell(printed, figure.measured(), digits) if is_known else "-")
                number = max(number, figure.units)
    if not rows:
        return None
    words = {unit: counted(number, unit) for unit in ("scenes", "sequences")} | dict(study.words)
    title, note = (declared.get(name, "").format_map(words) for name in ("title", "note"))
    header = [declared.get("corner", ""), *columns]
    return Table(declared["name"], title, header, list(rows.items()), note)


def _labels(
    declared: Mapping[str, Any], measure: str, study: Study, variants: list[str]
) -> list[tuple[str, ...]]:
    """Label and variants of each row; one without a label if rows are cases."""
    rows = declared.get("rows")
    if rows is None:
        return [("", *variants)]
    return list(named(study.variants(measure) if rows == "all" else rows).items())


def named(items: Mapping[str, Any] | Sequence[str]) -> Mapping[str, Any]:
    """A list of names that are their own labels as a mapping."""
    return items if isinstance(items, Mapping) else dict(zip(items, items, strict=True))


def _published(known: Any, label: str, row: int) -> float | None:
    """The published figure of a row; None without one."""
    if isinstance(known, Mapping):
        return known.get(label)
    figure = known[row] if isinstance(known, Sequence) else known
    return None if figure is None or math.isnan(figure) else figure
