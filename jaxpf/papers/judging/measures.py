"""Figures, cells and tables from the scenes' values, by measure and variant.

A paper lists its measures; ``claims.csv`` names the measure that judges a claim, the variant, and
the variant to compare with.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from jaxpf.files.tables import Rows, Table
from jaxpf.papers.judging.claims import Quantity, claims_of
from jaxpf.papers.judging.comparison_table import Cell
from jaxpf.papers.judging.estimates import gap_of, mean_of, ratio_of, share_of


class Measure(NamedTuple):
    """A measure of every variant of a study.

    Attributes:
        values: function of what was measured and of the variant -> the scenes' values: ``[S]``, or
            for percentages trials ``[S, n]``, bool or rates; a KeyError if it was not measured.
        kind: ``"mean"``, ``"percent"``, or ``"ratio"`` for positive values that are compared by
            the geometric mean of their ratios (without another variant: to 1).
        digits: decimal places in tables.
    """

    values: Callable[[Any, str], np.ndarray]
    kind: Literal["mean", "percent", "ratio"] = "mean"
    digits: int = 0

    def figure(self, measured: Any, variant: str, against: str = "", what: str = "") -> Quantity:
        """Estimate over scenes, or the comparison of two variants on their common scenes."""
        first = self.values(measured, variant)
        if not against:
            alone: dict[str, Callable[..., Quantity]]
            alone = {"mean": mean_of, "percent": share_of, "ratio": _ratio_to_one}
            return alone[self.kind](first, what)
        second = self.values(measured, against)
        first, second = (each[: min(len(first), len(second))] for each in (first, second))
        if self.kind == "mean":
            return mean_of(first - second, what)
        return (gap_of if self.kind == "percent" else ratio_of)(first, second, what)


def _ratio_to_one(values: np.ndarray, what: str) -> Quantity:
    return ratio_of(values, 1.0, what)


def quantities(
    paper: str, measures: Mapping[str, Measure], measured: Any
) -> dict[str, list[Quantity]]:
    """Key of a claim -> its figure, for claims whose measure and variants were measured."""
    figures = {}
    for key, claim in claims_of(paper).items():
        if claim.measure:
            try:
                figure = measures[claim.measure].figure(measured, claim.variant, claim.against)
            except KeyError:
                continue
            figures[key] = [figure]
    return figures


def measure_table(
    measured: Any,
    name: str,
    title: str,
    columns: Mapping[str, Measure],
    rows: Mapping[str, str] | Sequence[str],
    note: str = "",
    *,
    corner: str = "",
    published: Mapping[tuple[str, str], float] | None = None,
) -> Table:
    """A table of measures by variant.

    Args:
        measured: what was measured.
        name: see ``Table``.
        title: see ``Table``.
        columns: heading -> measure.
        rows: label -> variant, or the variants.
        note: see ``Table``.
        corner: heading of the labels.
        published: (variant, heading) -> published figure.
    """
    variants = rows if isinstance(rows, Mapping) else dict(zip(rows, rows, strict=True))
    cells: Rows = []
    for label, variant in variants.items():
        row: list[Any] = []
        for heading, measure in columns.items():
            figure = measure.figure(measured, variant).measured()
            known = (published or {}).get((variant, heading))
            row.append("-" if math.isnan(figure.value) else Cell(known, figure, measure.digits))
        cells.append((label, row))
    return Table(name, title, [corner, *columns], cells, note)
