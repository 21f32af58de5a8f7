"""Combines the evaluations of several sequences.

Sequences are the units, as in benchmark tables.  A sequence's value covers all its objects and
runs; for a method with several orders it is their mean.  Intervals are over sequences, so they are
wide for few sequences, regardless of the number of runs.
"""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from jaxpf.evaluation.estimates import ALL, LEVEL, difference, estimate
from jaxpf.evaluation.figures import accuracy_curves, in_style, save
from jaxpf.evaluation.measures import CURVES, FIGURES, MEASURES, SCORES
from jaxpf.evaluation.tables import measure_column, write_csv
from jaxpf.files.writing import remove_leavings
from jaxpf.measures.intervals import DECISIVE, mean_interval

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
    first, *others = methods = [*values.columns.unique("method")]
    columns = pd.MultiIndex.from_product([methods, measures], names=values.columns.names)
    values = values.reindex(columns=columns)
    tables = {"mean": estimate(values)}
    printed = {f"means over {len(names)} sequences": _table(methods, tables["mean"], PRINTED)}
    if others:
        apart = {method: difference(values[method], values[first]) for method in others}
        tables["difference"] = pd.concat(apart, names=["method"])
        compared = [name for name in PRINTED if name != "frames_per_second"]
        title = f"differences from {first}, paired by sequence"
        printed[title] = _table(others, tables["difference"], compared)
    remove_leavings(folder)
    every = pd.concat(tables, names=["what"]).rename(columns={"runs": "sequences"}).reset_index()
    shown = ["what", "method", "measure", "sequences", "value", "lower", "upper"]
    write_csv(folder / "overall.csv", every.loc[every.sequences > 0, shown])
    long = values.T.stack().dropna().rename("value").reset_index()
    write_csv(folder / "sequences.csv", long[["sequence", "method", "measure", "value"]])
    _draw(folder, _by_sequence(folder, names, "curves", varied, ["curve", "threshold"]), methods)
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
    folder: Path, names: Sequence[str], kind: str, varied: Sequence[str], columns: Sequence[str]
) -> pd.DataFrame:
    """Values over all objects: a row per sequence, a column per method and ``columns``."""
    files = {name: folder / name / f"{kind}.csv" for name in names}
    tables = {n: pd.read_csv(file, dtype=str, keep_default_na=False) for n, file in files.items()}
    table = pd.concat(tables, names=["sequence"])
    table = table[table.object == ALL].reset_index()
    for option in filter(table.columns.__contains__, varied):
        table["method"] += [f", {option} {x}" if x else "" for x in table[option].fillna("")]
    numbers = {name: float for name in ("value", "threshold") if name in table}
    table = table.astype(numbers).pivot_table("value", ["method", *columns], "sequence", sort=False)
    return table.reindex(columns=list(names)).T


def _draw(folder: Path, curves: pd.DataFrame, methods: Sequence[str]) -> None:
    """Draw success and precision curves: means over sequences with intervals."""
    ends = {}
    for method, curve in itertools.product(methods, CURVES):
        found = mean_interval(curves[method, curve].dropna(), level=LEVEL, bounds=(0.0, 1.0))
        ends[method, curve] = np.array([found.value, found.lower, found.upper])
    with in_style():
        save(accuracy_curves(methods, ends), folder / "overall.png")


def _table(methods: Sequence[str], found: pd.DataFrame, shown: Sequence[str]) -> pd.DataFrame:
    def of(measure: str) -> pd.DataFrame:
        return found.xs(measure, level="measure").loc[methods]

    columns = {"method": [*methods]}
    if of("iou").runs.nunique() > 1:
        columns["sequences"] = [*of("iou").runs.astype(str)]
    for measure in shown:
        columns |= measure_column(measure, of(measure)[["value", "lower", "upper"]].to_numpy())
    return pd.DataFrame(columns)
