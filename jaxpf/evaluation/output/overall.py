"""Combines the evaluations of several sequences.

Sequences are the units, as in benchmark tables.  A sequence's value covers all its objects and
runs; for a method with several orders it is their mean.  Intervals are over sequences, so they are
wide for few sequences, regardless of the number of runs.
"""

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.evaluation.measuring.measures import CURVES, FIGURES, MEASURES, SCORES, by_name
from jaxpf.evaluation.output.layout import (
    ABOUT_CALIBRATION,
    ABOUT_CONFIDENCE,
    ABOUT_MEASURES,
    NOTES,
    are_known,
    cells_of,
    heading,
    to_markdown,
)
from jaxpf.files.tables import Table
from jaxpf.files.writing import csv_text, write_text
from jaxpf.measures.intervals import (
    DECISIVE,
    Bounds,
    difference_interval,
    mean_interval,
    median_interval,
)

#: Measures in the terminal's tables.
PRINTED = (
    *("overlap", "success_half", "coverage_95", "size_coverage_95"),
    *("confidence_area", "frames_per_second"),
)
#: Measures in ``overall.md``; ``overall.csv`` has all.
SHOWN = (
    *("overlap", "success_half", "success_area", "coverage_50", "coverage_95"),
    *("size_coverage_50", "size_coverage_95", "confidence_area", "frames_per_second"),
    *("HOTA", "IDF1"),
)
FILES = ("overall.md", "overall.csv", "sequences.csv", "overall.png", "overall.pdf")


class OverSequences(NamedTuple):
    """A mean over sequences with its 95 % interval; a median where values have no bounds.

    Attributes:
        sequences: number of sequences that count.
        value: the mean or median.
        lower: lower end of the interval; NaN for too few sequences.
        upper: upper end of the interval.
    """

    sequences: int
    value: float
    lower: float
    upper: float


def write_overall(folder: Path, names: Sequence[str], varied: Sequence[str]) -> list[Table]:
    """Write ``FILES`` from the summaries of the evaluations in ``folder``.

    Args:
        folder: parent folder; ``folder / name`` holds a finished evaluation.
        names: of the sequences.
        varied: options with several values, which distinguish configurations.

    Returns:
        Tables for the terminal: means, and differences from the first method.

    Raises:
        InputError: a file cannot be written.
    """
    sequences = {
        name: _of_sequence(folder / name / "summary.csv", varied, lambda row: row["measure"])
        for name in names
    }
    methods = list(dict.fromkeys(method for each in sequences.values() for method in each))
    measures = [each.name for each in (*MEASURES, *SCORES, *FIGURES)]
    values = {
        (method, measure): np.array(
            [each.get(method, {}).get(measure, np.nan) for each in sequences.values()]
        )
        for method in methods
        for measure in measures
    }
    first = methods[0]
    means = {key: over_sequences(of, by_name(key[1]).bounds) for key, of in values.items()}
    differences = {
        (method, measure): over_sequences(of, by_name(measure).bounds, values[first, measure])
        for (method, measure), of in values.items()
        if method != first
    }

    def tables_of(shown: Sequence[str]) -> list[Table]:
        tables = [_table(f"means over {len(names)} sequences", methods, means, shown)]
        if len(methods) > 1:
            title = f"differences from {first}, paired by sequence"
            compared = [name for name in shown if name != "frames_per_second"]
            tables.append(_table(title, methods[1:], differences, compared))
        return tables

    notes = [
        about_units(len(names)),
        *(NOTES[n] for n in (ABOUT_MEASURES, ABOUT_CALIBRATION, ABOUT_CONFIDENCE)),
    ]
    text = to_markdown("Over all sequences", tables_of(SHOWN), [", ".join(names)], notes)
    write_text(folder / "overall.md", text)
    write_text(folder / "overall.csv", csv_text(_rows(means, differences)))
    rows = [
        [name, method, measure, f"{x:.7g}"]
        for (method, measure), of in values.items()
        for name, x in zip(names, of, strict=True)
        if np.isfinite(x)
    ]
    header = ["sequence", "method", "measure", "value"]
    write_text(folder / "sequences.csv", csv_text([header, *rows]))
    _draw(folder, names, methods, varied)
    return tables_of(PRINTED)


def about_units(sequences: int) -> str:
    """Note on the units, for readers of the tables."""
    text = (
        "Sequences are the units of the 95 % intervals: of means of shares from three on, of "
        "medians of other values from six on."
    )
    few = f" Fewer than {DECISIVE} sequences are a preview and decide nothing."
    return text + few * (sequences < DECISIVE)


def over_sequences(
    values: np.ndarray, bounds: Bounds | None, reference: np.ndarray | None = None
) -> OverSequences:
    """Mean of the finite ``values [S]``, or of their paired differences from a reference.

    Without bounds it is the median.
    """
    apart = values if reference is None else values - reference
    if bounds is None:
        found = median_interval(apart)
    elif reference is None:
        found = mean_interval(values, bounds=bounds)
    else:
        found = difference_interval(values, reference, bounds=bounds)
    return OverSequences(np.isfinite(apart).sum(), found.value, found.lower, found.upper)


def _of_sequence(
    path: Path, varied: Sequence[str], key: Callable[[dict[str, str]], Any]
) -> dict[str, dict[Any, float]]:
    """Map method with varied options -> row key -> mean value over all objects."""
    gathered: dict[str, dict[Any, list[float]]] = {}
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            if row["object"] != "all":
                continue
            options = [f"{name} {row[name]}" for name in varied if row.get(name)]
            method = ", ".join([row["method"], *options])
            by_key = gathered.setdefault(method, {})
            by_key.setdefault(key(row), []).append(float(row["value"]))
    return {
        method: {name: float(np.mean(each)) for name, each in by_key.items()}
        for method, by_key in gathered.items()
    }


def _draw(
    folder: Path, names: Sequence[str], methods: Sequence[str], varied: Sequence[str]
) -> None:
    """Draw success and precision curves: means over sequences with intervals."""
    from jaxpf.evaluation.output import charts
    from jaxpf.evaluation.output.figures import in_style, save

    def point(row: dict[str, str]) -> tuple[str, float]:
        return row["curve"], float(row["threshold"])

    each_curve = [_of_sequence(folder / name / "curves.csv", varied, point) for name in names]
    curves = {
        (method, curve): np.array(
            [
                over_sequences(
                    np.array([each[method][curve, t] for each in each_curve if method in each]),
                    (0, 1),
                )[1:]
                for t in thresholds.tolist()
            ]
        ).T
        for curve, thresholds in CURVES.items()
        for method in methods
    }
    with in_style():
        save(charts.accuracy_curves(methods, curves), folder / "overall.png")


def _table(
    title: str,
    methods: Sequence[str],
    means: Mapping[tuple[str, str], OverSequences],
    shown: Sequence[str],
) -> Table:
    table = Table("overall", title, ["method"], [(method, []) for method in methods])
    counts = [means[method, "overlap"].sequences for method in methods]
    if len(set(counts)) > 1:
        table.add("sequences", map(str, counts))
    for measure in map(by_name, shown):
        values = np.array([means[method, measure.name][1:] for method in methods])
        if are_known(values):
            table.add(heading(measure), cells_of(measure, values))
    return table


def _rows(*given: Mapping[tuple[str, str], OverSequences]) -> Iterator[list[Any]]:
    yield ["what", "method", "measure", *OverSequences._fields]
    for what, means in zip(("mean", "difference"), given, strict=True):
        for (method, measure), of in means.items():
            if of.sequences:
                ends = [f"{x:.7g}" if np.isfinite(x) else "" for x in of[1:]]
                yield [what, method, measure, of.sequences, *ends]
