"""Combines the evaluations of several sequences.

Sequences are the units, as in benchmark tables.  A sequence's value covers all its objects and
runs; for a method with several orders it is their mean.  Intervals are over sequences, so they are
wide for few sequences, regardless of the number of runs.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from jaxpf.evaluation.estimates import Difference, Estimate, difference, estimate
from jaxpf.evaluation.figures import accuracy_curves, in_style, save
from jaxpf.evaluation.measures import CURVES, FIGURES, MEASURES, SCORES, by_name
from jaxpf.evaluation.summaries import ALL
from jaxpf.evaluation.tables import measure_column, write_csv
from jaxpf.files.writing import remove_leavings
from jaxpf.measures.intervals import DECISIVE

#: Measures in the terminal's tables; ``overall.csv`` has all.
PRINTED = (
    *("iou", "success_rate_50", "coverage_95", "size_coverage_95"),
    *("confidence_area", "silent", "frames_per_second"),
)
FILES = ("overall.csv", "sequences.csv", "overall.png")


def write_overall(
    folder: Path, names: Sequence[str], varied: Sequence[str]
) -> dict[str, pd.DataFrame]:
    """Write ``FILES`` from the tables of each sequence.

    Args:
        folder: for the files; each sequence's evaluation is in a folder of its name below.
        names: of the sequences.
        varied: options with several values, which distinguish configurations.

    Returns:
        Tables for the terminal: means, and differences from the first method.

    Raises:
        InputError: a file cannot be written.
    """
    measures = [each.name for each in (*MEASURES, *SCORES, *FIGURES)]
    values = _by_sequence(folder, names, "summary", varied, ["measure"])
    first, *others = methods = list(values.index.unique("method"))
    values = values.reindex(pd.MultiIndex.from_product([methods, measures]))
    units = {key: _units(values.loc[[key]]) for key in values.index}
    means = {key: estimate(*each, by_name(key[1]).bounds) for key, each in units.items()}
    differences = {
        (method, measure): difference(
            units[method, measure], units[first, measure], by_name(measure).bounds
        )
        for method in others
        for measure in measures
    }
    remove_leavings(folder)
    rows = [
        [what, *key, found.runs[0], *(x[0] for x in (found.value, found.lower, found.upper))]
        for what, every in (("mean", means), ("difference", differences))
        for key, found in every.items()
        if found.runs[0]
    ]
    columns = ["what", "method", "measure", "sequences", "value", "lower", "upper"]
    write_csv(folder / "overall.csv", pd.DataFrame(rows, columns=columns))
    long = values.stack().dropna().rename("value").rename_axis(["method", "measure", "sequence"])
    columns = ["sequence", "method", "measure", "value"]
    write_csv(folder / "sequences.csv", long.reset_index()[columns])
    curves = _by_sequence(folder, names, "curves", varied, ["curve", "threshold"])
    _draw(folder, curves, methods)
    printed = {f"means over {len(names)} sequences": _table(methods, means, PRINTED)}
    if others:
        title = f"differences from {first}, paired by sequence"
        compared = [name for name in PRINTED if name != "frames_per_second"]
        printed[title] = _table(others, differences, compared)
    return printed


def about_units(sequences: int) -> str:
    """Note on the units, for readers of the tables."""
    text = (
        "Sequences are the units of the 95% intervals: of means of shares from three on, of "
        "medians of other values from six on."
    )
    few = f" Fewer than {DECISIVE} sequences are a preview and decide nothing."
    return text + few * (sequences < DECISIVE)


def _by_sequence(
    folder: Path, names: Sequence[str], kind: str, varied: Sequence[str], rows: Sequence[str]
) -> pd.DataFrame:
    """Values over all objects: a row per method and ``rows``, a column per sequence."""
    files = {name: folder / name / f"{kind}.csv" for name in names}
    tables = {n: pd.read_csv(file, dtype=str, keep_default_na=False) for n, file in files.items()}
    table = pd.concat(tables, names=["sequence"])
    table = table[table.object == ALL].reset_index()
    for option in filter(table.columns.__contains__, varied):
        table["method"] += [f", {option} {x}" if x else "" for x in table[option].fillna("")]
    numbers = {name: float for name in ("value", "threshold") if name in table}
    table = table.astype(numbers).pivot_table("value", ["method", *rows], "sequence", sort=False)
    return table.reindex(columns=list(names))


def _units(rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Values and weights of the sequences, ``[S, K]`` each, of K rows of ``_by_sequence``."""
    return rows.to_numpy().T, np.ones(rows.shape[::-1])


def _draw(folder: Path, curves: pd.DataFrame, methods: Sequence[str]) -> None:
    """Draw success and precision curves: means over sequences with intervals."""
    found = {
        (method, curve): estimate(*_units(curves.loc[method, curve].dropna(axis=1)), (0, 1))
        for method in methods
        for curve in CURVES
    }
    ends = {key: np.array([x.value, x.lower, x.upper])[:, :-1] for key, x in found.items()}
    with in_style():
        save(accuracy_curves(methods, ends), folder / "overall.png")


def _table(
    methods: Sequence[str],
    found: Mapping[tuple[str, str], Estimate | Difference],
    shown: Sequence[str],
) -> pd.DataFrame:
    columns = {"method": list(methods)}
    counts = [found[method, "iou"].runs[0] for method in methods]
    if len(set(counts)) > 1:
        columns["sequences"] = list(map(str, counts))
    for measure in shown:
        every = [found[method, measure] for method in methods]
        values = np.array([[x[0] for x in (e.value, e.lower, e.upper)] for e in every])
        columns |= measure_column(measure, values)
    return pd.DataFrame(columns)
