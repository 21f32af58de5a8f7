"""Writes the tables of an evaluation: all runs, summaries over runs, curves and differences.

``write_tables`` writes into the evaluation's folder

* ``results.csv``: one row per scene, method, ordering, parameters, seed, run and object, readable
  by ``pandas.read_csv`` without options;
* ``summary.csv``: one row per configuration, object ("all" for all objects) and measure;
* ``curves.csv``: success and precision curves of every configuration and object;
* ``differences.csv``: configurations minus their references, on common seeds;
* ``summary.md``: the main tables.

Undefined fields, such as the precision of an object that was never tracked, are empty.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import import_extra
from jaxpf.contract.options import plain
from jaxpf.evaluation.measuring.collection import Summary
from jaxpf.evaluation.measuring.measures import COLUMNS, CURVES
from jaxpf.evaluation.measuring.overview import Overview, measure_results
from jaxpf.evaluation.output.layout import (
    MOST_PRINTED,
    PRINTED,
    calibration_tables,
    difference_tables,
    estimate_tables,
    score_tables,
    to_markdown,
)
from jaxpf.evaluation.work.results import Configuration, Results
from jaxpf.files.tables import Table
from jaxpf.files.writing import atomic_write, csv_text, write_text

if TYPE_CHECKING:
    import pandas as pd

_KEYS = ("scene", "method", "ordering")


def write_tables(results: Results) -> Overview:
    """Measure the runs of an evaluation, finished or not, and write all tables.

    Raises:
        InputError: a file cannot be written, a batch is damaged, or pandas is not installed.
    """
    pandas = import_extra("pandas", "writing tables needs pandas")
    overview = measure_results(results)
    summaries, ids = overview.summaries, results.object_ids
    with atomic_write(results.folder / "results.csv") as file:
        for rows_of_run in _run_rows(results, summaries):
            file.write(csv_text(rows_of_run))
    for name, (columns, *rows) in (
        ("summary", _summary_rows(results, summaries)),
        ("curves", _curve_rows(results, summaries)),
        ("differences", _difference_rows(results, summaries)),
    ):
        overview.tables[name] = pandas.DataFrame(rows, columns=columns, dtype=str)
        write_csv(results.folder / f"{name}.csv", overview.tables[name])
    everything = [
        *estimate_tables(ids, summaries),
        *score_tables(ids, summaries),
        *calibration_tables(ids, summaries),
        *difference_tables(ids, summaries),
    ]
    title = f"{results.scene_name}, {results.runs} runs"
    lines = [overview.conclusion, *overview.remarks]
    write_text(results.folder / "summary.md", to_markdown(title, everything, lines))
    return overview


def stored_tables(folder: Path) -> "dict[str, pd.DataFrame]":
    """``Overview.tables`` as ``write_tables`` wrote them into an evaluation's folder."""
    from pandas import read_csv

    stored = {"dtype": str, "keep_default_na": False}
    return {name: read_csv(folder / f"{name}.csv", **stored) for name in ("summary", "curves")}


def write_csv(path: Path, table: "pd.DataFrame") -> None:
    """Write a data frame with seven digits; undefined numbers are empty."""
    with atomic_write(path) as file:
        table.to_csv(file, index=False, float_format="%.7g", lineterminator="\n")


def printed_tables(results: Results, overview: Overview) -> list[Table]:
    """The table for the terminal: all objects, the best configurations."""
    summaries, best = overview.summaries, overview.ranked[:MOST_PRINTED]
    printed = estimate_tables(results.object_ids, best, PRINTED)[:1]
    if len(best) < len(summaries):
        title = f"all objects: the best {len(best)} of {len(summaries)} configurations"
        printed = [dataclasses.replace(table, title=title) for table in printed]
    return printed


def _run_rows(results: Results, summaries: Sequence[Summary]) -> Iterator[list[list[object]]]:
    """Yield the rows of one run of one configuration at a time; the header comes first."""
    yield [[*_KEYS, *_parameters(results), "seed", "run", "object", *COLUMNS]]
    for summary in summaries:
        keys = [*_keys(results, summary.configuration), results.seed]
        for run, objects in zip(summary.numbers, summary.columns, strict=True):
            yield [
                [*keys, run, identity, *("" if math.isnan(x) else f"{x:.7g}" for x in values)]
                for identity, values in zip(results.object_ids, objects.tolist(), strict=True)
            ]


def _summary_rows(results: Results, summaries: Sequence[Summary]) -> Iterator[list[object]]:
    fields = ("runs", "value", "standard_error", "lower", "upper")
    yield [*_KEYS, *_parameters(results), "object", "measure", *fields]
    for summary in summaries:
        keys = _keys(results, summary.configuration)
        yield from _object_rows(results, keys, summary.estimates, fields)
        confidence = summary.confidence
        shares = confidence.shares()
        for place in range(confidence.bins):
            if confidence.frames[place]:
                numbers = [_number(x[place]) for x in (confidence.runs, *shares)]
                yield [*keys, "all", f"on_object_{place}", *numbers]


def _curve_rows(results: Results, summaries: Sequence[Summary]) -> Iterator[list[object]]:
    yield [*_KEYS, *_parameters(results), "object", "curve", "threshold", "value", "lower", "upper"]
    for summary in summaries:
        keys = _keys(results, summary.configuration)
        for name, thresholds in CURVES.items():
            curve = getattr(summary, name)
            for place, identity in _known(results, curve.value[:, 0]):
                for number, threshold in enumerate(thresholds):
                    at = place, number
                    ends = map(_number, (curve.value[at], curve.lower[at], curve.upper[at]))
                    yield [*keys, identity, name, f"{threshold:g}", *ends]


def _difference_rows(results: Results, summaries: Sequence[Summary]) -> Iterator[list[object]]:
    fields = ("runs", "value", "standard_error", "lower", "upper", "gained", "lost", "p", "p_holm")
    names = ("runs", "difference", *fields[2:])
    yield [*_KEYS, *_parameters(results), "reference", "object", "measure", *names]
    for summary in summaries:
        if summary.reference is not None:
            keys = [*_keys(results, summary.configuration), summaries[summary.reference].name]
            yield from _object_rows(results, keys, summary.differences, fields)


def _object_rows(
    results: Results, keys: list[object], found: Mapping[str, Any], fields: Sequence[str]
) -> Iterator[list[object]]:
    """A row for every measure and object with a value."""
    for measure, each in found.items():
        for place, identity in _known(results, each.value):
            numbers = [_number(getattr(each, field)[place]) for field in fields]
            yield [*keys, identity, measure, *numbers]


def _known(results: Results, values: np.ndarray) -> Iterator[tuple[int, str]]:
    """Index and name of each object that has a value; "all" comes last."""
    names = [*map(str, results.object_ids), "all"]
    return ((place, name) for place, name in enumerate(names) if np.isfinite(values[place]))


def _parameters(results: Results) -> list[str]:
    """Names of all parameters, in the order of the configurations."""
    names = (name for c in results.configurations for name in c.parameters)
    return list(dict.fromkeys(names))


def _keys(results: Results, configuration: Configuration) -> list[object]:
    values = [_cell(configuration.parameters.get(name)) for name in _parameters(results)]
    return [results.scene_name, configuration.method, configuration.ordering, *values]


def _cell(value: object) -> object:
    """Format an option's value for a CSV field."""
    return "" if value is None else plain(value) if isinstance(value, tuple) else value


def _number(value: float) -> str:
    return f"{value:.7g}" if np.isfinite(value) else ""
