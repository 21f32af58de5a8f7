"""Combines the evaluations of several sequences.

Sequences are the units, as in benchmark tables.  A sequence's value covers all its objects and
runs; for a method with several orders it is their mean.  Intervals are over sequences, so they are
wide for few sequences, regardless of the number of runs.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pandas import DataFrame, MultiIndex, concat

from jaxpf.evaluation.measuring.estimates import Difference, Estimate, difference, estimate
from jaxpf.evaluation.measuring.measures import CURVES, FIGURES, MEASURES, SCORES, by_name
from jaxpf.evaluation.output import charts
from jaxpf.evaluation.output.figures import in_style, save
from jaxpf.evaluation.output.layout import (
    ABOUT_CALIBRATION,
    ABOUT_CONFIDENCE,
    ABOUT_MEASURES,
    NOTES,
    are_known,
    cells_of,
    heading,
    to_markdown,
    triples,
)
from jaxpf.evaluation.output.tables import write_csv
from jaxpf.files.tables import Table
from jaxpf.files.writing import remove_leavings, write_text
from jaxpf.measures.intervals import DECISIVE

if TYPE_CHECKING:
    import pandas as pd

#: Measures in the terminal's tables.
PRINTED = (
    *("iou", "success_rate_50", "coverage_95", "size_coverage_95"),
    *("confidence_area", "silent", "frames_per_second"),
)
#: Measures in ``overall.md``; ``overall.csv`` has all.
SHOWN = (
    *("iou", "success_rate_50", "success_auc", "coverage_50", "coverage_95"),
    *("size_coverage_50", "size_coverage_95", "confidence_area", "silent", "frames_per_second"),
    *("HOTA", "IDF1"),
)
FILES = ("overall.md", "overall.csv", "sequences.csv", "overall.png", "overall.pdf")


#: Sequence -> its data frames "summary" and "curves", see ``output.tables``.
Tables = Mapping[str, Mapping[str, Any]]


def write_overall(folder: Path, tables: Tables, varied: Sequence[str]) -> list[Table]:
    """Write ``FILES`` from the tables of each sequence.

    Args:
        folder: for the files.
        tables: of every sequence.
        varied: options with several values, which distinguish configurations.

    Returns:
        Tables for the terminal: means, and differences from the first method.

    Raises:
        InputError: a file cannot be written.
    """
    names = list(tables)
    measures = [each.name for each in (*MEASURES, *SCORES, *FIGURES)]
    values = _by_sequence(tables, "summary", varied, ["measure"])
    first, *others = methods = list(values.index.unique("method"))
    values = values.reindex(MultiIndex.from_product([methods, measures]))
    units = {key: _units(values.loc[[key]]) for key in values.index}
    means = {key: estimate(*each, by_name(key[1]).bounds) for key, each in units.items()}
    differences = {
        (method, measure): difference(
            units[method, measure], units[first, measure], by_name(measure).bounds
        )
        for method in others
        for measure in measures
    }

    def tables_of(shown: Sequence[str]) -> list[Table]:
        tables = [_table(f"means over {len(names)} sequences", methods, means, shown)]
        if others:
            title = f"differences from {first}, paired by sequence"
            compared = [name for name in shown if name != "frames_per_second"]
            tables.append(_table(title, others, differences, compared))
        return tables

    notes = [
        about_units(len(names)),
        *(NOTES[n] for n in (ABOUT_MEASURES, ABOUT_CALIBRATION, ABOUT_CONFIDENCE)),
    ]
    text = to_markdown("Over all sequences", tables_of(SHOWN), [", ".join(names)], notes)
    remove_leavings(folder)
    write_text(folder / "overall.md", text)
    rows = [
        [what, *key, found.runs[0], *(x[0] for x in (found.value, found.lower, found.upper))]
        for what, every in (("mean", means), ("difference", differences))
        for key, found in every.items()
        if found.runs[0]
    ]
    columns = ["what", "method", "measure", "sequences", "value", "lower", "upper"]
    write_csv(folder / "overall.csv", DataFrame(rows, columns=columns))
    long = values.stack().dropna().rename("value").rename_axis(["method", "measure", "sequence"])
    columns = ["sequence", "method", "measure", "value"]
    write_csv(folder / "sequences.csv", long.reset_index()[columns])
    _draw(folder, _by_sequence(tables, "curves", varied, ["curve", "threshold"]), methods)
    return tables_of(PRINTED)


def about_units(sequences: int) -> str:
    """Note on the units, for readers of the tables."""
    text = (
        "Sequences are the units of the 95% intervals: of means of shares from three on, of "
        "medians of other values from six on."
    )
    few = f" Fewer than {DECISIVE} sequences are a preview and decide nothing."
    return text + few * (sequences < DECISIVE)


def _by_sequence(
    tables: Tables, name: str, varied: Sequence[str], rows: Sequence[str]
) -> "pd.DataFrame":
    """Values over all objects: a row per method and ``rows``, a column per sequence."""
    table = concat({key: each[name] for key, each in tables.items()}, names=["sequence"])
    table = table[table.object == "all"].reset_index()
    for option in filter(table.columns.__contains__, varied):
        table["method"] += [f", {option} {x}" if x else "" for x in table[option].fillna("")]
    numbers = {name: float for name in ("value", "threshold") if name in table}
    table = table.astype(numbers).pivot_table("value", ["method", *rows], "sequence", sort=False)
    return table.reindex(columns=list(tables))


def _units(rows: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """Values and weights of the sequences, ``[S, K]`` each, of K rows of ``_by_sequence``."""
    return rows.to_numpy().T, np.ones(rows.shape[::-1])


def _draw(folder: Path, curves: "pd.DataFrame", methods: Sequence[str]) -> None:
    """Draw success and precision curves: means over sequences with intervals."""
    found = {
        (method, curve): estimate(*_units(curves.loc[method, curve].dropna(axis=1)), (0, 1))
        for method in methods
        for curve in CURVES
    }
    ends = {key: np.array([x.value, x.lower, x.upper])[:, :-1] for key, x in found.items()}
    with in_style():
        save(charts.accuracy_curves(methods, ends), folder / "overall.png")


def _table(
    title: str,
    methods: Sequence[str],
    found: Mapping[tuple[str, str], Estimate | Difference],
    shown: Sequence[str],
) -> Table:
    table = Table("overall", title, ["method"], [(method, []) for method in methods])
    counts = [found[method, "iou"].runs[0] for method in methods]
    if len(set(counts)) > 1:
        table.add("sequences", map(str, counts))
    for measure in map(by_name, shown):
        values = triples([found[method, measure.name] for method in methods], 0)
        if are_known(values):
            table.add(heading(measure), cells_of(measure, values))
    return table
