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
from jaxpf.papers.judging.estimates import gain_of, gap_of, mean_of, ratio_of, share_of


def _ratio_to_one(values: np.ndarray, what: str) -> Quantity:
    return ratio_of(values, 1.0, what)


def _difference(first: np.ndarray, second: np.ndarray, what: str) -> Quantity:
    return mean_of(first - second, what)


_ALONE: Mapping[str, Callable[..., Quantity]]
_ALONE = {"mean": mean_of, "percent": share_of, "ratio": _ratio_to_one, "gain": mean_of}
_COMPARED: Mapping[str, Callable[..., Quantity]]
_COMPARED = {"mean": _difference, "percent": gap_of, "ratio": ratio_of, "gain": gain_of}


class Measure(NamedTuple):
    """A measure of every variant of a study.

    Attributes:
        values: function of what was measured and of the variant -> the scenes' values: ``[S]``, or
            for percentages trials ``[S, n]``, bool or rates; of several cases, such as sharpness
            values, one such array for each, by the case's name; a KeyError if it was not measured.
        kind: ``"mean"``, ``"percent"``, or for positive values that are compared by the geometric
            mean of their ratios ``"ratio"`` (without another variant: to 1) or ``"gain"``, one less
            the ratio in per cent (without another variant: the mean).
        digits: decimal places in tables.
    """

    values: Callable[[Any, str], Any]
    kind: Literal["mean", "percent", "ratio", "gain"] = "mean"
    digits: int = 0

    def figures(self, measured: Any, variant: str, against: str = "") -> list[Quantity]:
        """Of each case, the estimate over scenes, or two variants' on their common scenes."""
        first = _by_case(self.values(measured, variant))
        if not against:
            return [_ALONE[self.kind](values, what) for what, values in first.items()]
        figures, second = [], _by_case(self.values(measured, against))
        for what, values in first.items():
            common = min(len(values), len(second[what]))
            figures.append(_COMPARED[self.kind](values[:common], second[what][:common], what))
        return figures


def _by_case(values: Any) -> Mapping[str, np.ndarray]:
    return values if isinstance(values, Mapping) else {"": values}


def quantities(
    paper: str, measures: Mapping[str, Measure], measured: Any
) -> dict[str, list[Quantity]]:
    """Key of a claim -> its figures, for claims whose measure and variants were measured."""
    figures = {}
    for key, claim in claims_of(paper).items():
        if claim.measure:
            try:
                measure = measures[claim.measure]
                figures[key] = measure.figures(measured, claim.variant, claim.against)
            except KeyError:
                continue
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
        row = []
        for heading, measure in columns.items():
            (figure,) = measure.figures(measured, variant)
            row.append(_cell(figure, measure.digits, (published or {}).get((variant, heading))))
        cells.append((label, row))
    return Table(name, title, [corner, *columns], cells, note)


def case_table(
    measured: Any,
    name: str,
    title: str,
    columns: Mapping[str, tuple[Any, ...]],
    note: str = "",
    *,
    corner: str = "",
    published: Mapping[str, Sequence[float | None]] | None = None,
) -> Table:
    """A table with a row for each case.

    Args:
        measured: what was measured.
        name: see ``Table``.
        title: see ``Table``.
        columns: heading -> measure, variant, and perhaps the variant to compare with.
        note: see ``Table``.
        corner: heading of the cases.
        published: heading -> published figures of all cases.
    """
    rows: dict[str, list[Any]] = {}
    for heading, (measure, *variants) in columns.items():
        figures = measure.figures(measured, *variants)
        known = (published or {}).get(heading, [None] * len(figures))
        for figure, printed in zip(figures, known, strict=True):
            rows.setdefault(figure.what, []).append(_cell(figure, measure.digits, printed))
    return Table(name, title, [corner, *columns], list(rows.items()), note)


def _cell(figure: Quantity, digits: int, published: float | None) -> Cell | str:
    return "-" if math.isnan(figure.value) else Cell(published, figure.measured(), digits)
