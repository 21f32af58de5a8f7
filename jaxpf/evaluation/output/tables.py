"""Writes the tables of an evaluation: all runs, summaries over runs, and tracks of chosen runs.

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
import itertools
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from jaxpf import filters
from jaxpf.contract.options import plain
from jaxpf.evaluation.collection import SCORED_RUNS, Collected, Curve, collect, has_scores
from jaxpf.evaluation.conclusion import Conclusion, conclude
from jaxpf.evaluation.measures import COLUMNS, CURVES
from jaxpf.evaluation.output.layout import (
    PRINTED,
    calibration_tables,
    difference_tables,
    estimate_tables,
    reliability_line,
    reliability_tables,
    score_tables,
    to_markdown,
)
from jaxpf.evaluation.results import BUILT_IN, Configuration, Results
from jaxpf.evaluation.summary import Summary, configuration_name, summarise
from jaxpf.evaluation.work.batches import Batch
from jaxpf.files.tables import Table
from jaxpf.files.writing import atomic_write, csv_text, report_os_errors, write_text

#: Remark for scenes with a single object.
ONE_OBJECT = (
    "One object: there is nothing to order, so all orderings coincide (SIR, PS, DPS, SPS) and one "
    "is run unless methods are named."
)
_KEYS = ("scene", "method", "ordering")
#: Most configurations in the terminal's table.
MOST_PRINTED = 10
_ENOUGH = 20  # runs; there the normal quantile is 6 % below Student's
_NUMBERS = ",".join(["%.7g"] * len(COLUMNS))


@dataclasses.dataclass(frozen=True)
class Tables:
    """Result of ``write_tables``.

    Attributes:
        summaries: of every configuration with finished runs.
        remarks: sentences about missing results and caveats.
        conclusion: which configuration is best.
    """

    summaries: list[Summary]
    remarks: list[str]
    conclusion: Conclusion

    def best_first(self, most: int = MOST_PRINTED) -> list[Summary]:
        """The first ``most`` configurations, best first and those without a value last."""
        ranking = self.conclusion.ranking
        rest = [index for index in range(len(self.summaries)) if index not in ranking]
        return [self.summaries[index] for index in [*ranking, *rest][:most]]


def write_tables(results: Results) -> Tables:
    """Write all tables of an evaluation, finished or not; memory does not grow with the runs.

    Raises:
        InputError: a file cannot be written; a batch is damaged.
    """
    configurations = results.configurations
    with report_os_errors("write into", results.folder):
        for leaving in results.folder.glob(".tables-*"):  # from a killed process
            shutil.rmtree(leaving, ignore_errors=True)
        scratch = tempfile.TemporaryDirectory(dir=results.folder, prefix=".tables-")
    with scratch as store, atomic_write(results.folder / "results.csv") as file:
        writer = _RowWriter(file, results)
        collected: list[Collected] = []
        for index, configuration in enumerate(configurations):
            folder = Path(store) / f"{index}"
            folder.mkdir()
            rows = writer.for_configuration(configuration)
            if (entry := collect(results, configuration, folder, rows)) is not None:
                collected.append(entry)
        summaries = summarise(results, collected)
        conclusion = conclude(results, summaries, collected)
    remarks = _remarks(results, summaries)
    for name, rows in (
        ("summary", _summary_rows(results, summaries)),
        ("curves", _curve_rows(results, summaries)),
        ("differences", _difference_rows(results, summaries)),
    ):
        write_text(results.folder / f"{name}.csv", csv_text(rows))
    ids = results.object_ids
    places = [len(ids), *range(len(ids))]
    everything = [
        *estimate_tables(ids, summaries, places),
        *score_tables(summaries, len(ids)),
        *calibration_tables(ids, summaries, places),
        *reliability_tables(summaries),
        *difference_tables(ids, summaries, places),
    ]
    tables = Tables(summaries, remarks, conclusion)
    confident = (summary for summary in tables.best_first() if summary.confidence.frames[-1])
    remarks += [reliability_line(summary) for summary in itertools.islice(confident, 1)]
    title = f"{results.scene_name}, {results.runs} runs"
    lines = [conclusion.sentence, *remarks]
    write_text(results.folder / "summary.md", to_markdown(title, everything, lines))
    return tables


def printed_tables(results: Results, tables: Tables) -> list[Table]:
    """The table for the terminal: all objects, the best configurations."""
    summaries, best = tables.summaries, tables.best_first()
    printed = estimate_tables(results.object_ids, best, [len(results.object_ids)], PRINTED)
    if len(best) < len(summaries):
        title = f"all objects: the best {len(best)} of {len(summaries)} configurations"
        printed = [dataclasses.replace(table, title=title) for table in printed]
    return printed


class _RowWriter:
    """Writes the rows of ``results.csv`` batch by batch."""

    def __init__(self, file: IO[str], results: Results):
        self._file, self._results = file, results
        header = [*_KEYS, *_parameters(results), "seed", "run", "object", *COLUMNS]
        file.write(csv_text([header]))

    def for_configuration(self, configuration: Configuration) -> Any:
        results, file = self._results, self._file
        prefix = csv_text([_keys(results, configuration)]).rstrip("\n")
        ids = results.object_ids

        def write(batch: Batch, columns: np.ndarray) -> None:
            lines = []
            runs = zip(batch.seeds.tolist(), batch.runs.tolist(), columns.tolist(), strict=True)
            for seed, run, objects in runs:
                for identity, values in zip(ids, objects, strict=True):
                    numbers = (_NUMBERS % tuple(values)).replace("nan", "")
                    lines.append(f"{prefix},{seed},{run},{identity},{numbers}\n")
            file.write("".join(lines))

        return write


def _remarks(results: Results, summaries: Sequence[Summary]) -> list[str]:
    remarks = []
    finished = {summary.name: summary.runs for summary in summaries}
    for configuration in results.configurations:
        name = configuration_name(results, configuration)
        runs = finished.get(name, 0)
        if configuration.is_imported:
            remarks.append(f"{name}: one track, the same for every seed; without intervals.")
        elif runs < results.runs:
            remarks.append(f"{name}: {runs} of {results.runs} runs are finished.")
    ours = [c for c in results.configurations if c.kind == BUILT_IN]
    ordered = any(filters.filter_of(c.method.lower()).by_default for c in ours)
    if len(results.object_ids) == 1 and ordered:
        remarks.append(ONE_OBJECT)
    fewest = min((s.runs for s in summaries if not s.configuration.is_imported), default=_ENOUGH)
    if fewest < _ENOUGH:
        remarks.append(
            f"With fewer than {_ENOUGH} runs the normal intervals of means are too narrow; those "
            "of rates and of differences are not."
        )
    if not has_scores():
        remarks.append(
            "HOTA, MOTA and IDF1 are left out; pip install --no-deps trackeval adds them."
        )
    elif any(summary.runs > SCORED_RUNS for summary in summaries):
        remarks.append(f"HOTA, MOTA and IDF1 are of the first {SCORED_RUNS} runs.")
    return remarks


def _summary_rows(results: Results, summaries: Iterable[Summary]) -> Iterator[list[Any]]:
    fields = ("runs", "value", "standard_error", "lower", "upper")
    yield [*_KEYS, *_parameters(results), "object", "measure", *fields]
    for summary in summaries:
        keys = _keys(results, summary.configuration)
        for measure, estimate in summary.estimates.items():
            for place, identity in _known(results, estimate.value):
                numbers = [_number(getattr(estimate, field)[place]) for field in fields]
                yield [*keys, identity, measure, *numbers]
        confidence, shares = summary.confidence, summary.confidence.shares()
        for place in range(confidence.bins):
            if confidence.frames[place]:
                numbers = [_number(x[place]) for x in (confidence.runs, *shares)]
                yield [*keys, "all", f"on_object_{place}", *numbers]
        for measure, value in (
            ("confidence_area", confidence.area()),
            ("frames_per_second", summary.frames_per_second),
        ):
            if np.isfinite(value):
                yield [*keys, "all", measure, 1, _number(value), "", "", ""]


def _curve_rows(results: Results, summaries: Iterable[Summary]) -> Iterator[list[Any]]:
    yield [*_KEYS, *_parameters(results), "object", "curve", "threshold", *Curve._fields]
    for summary in summaries:
        keys = _keys(results, summary.configuration)
        for name, thresholds in CURVES.items():
            curve = getattr(summary, name)
            for place, identity in _known(results, curve.value[:, 0]):
                for number, threshold in enumerate(thresholds):
                    ends = [_number(each[place, number]) for each in curve]
                    yield [*keys, identity, name, f"{threshold:g}", *ends]


def _difference_rows(results: Results, summaries: Sequence[Summary]) -> Iterator[list[Any]]:
    fields = ("runs", "value", "standard_error", "lower", "upper", "gained", "lost", "p")
    names = ("runs", "difference", *fields[2:], "p_holm")
    yield [*_KEYS, *_parameters(results), "reference", "object", "measure", *names]
    for summary in summaries:
        if summary.reference is None:
            continue
        keys = _keys(results, summary.configuration)
        reference = summaries[summary.reference].name
        for measure, difference in summary.differences.items():
            for place, identity in _known(results, difference.value):
                numbers = [_number(getattr(difference, field)[place]) for field in fields]
                adjusted = _number(summary.adjusted[measure][place])
                yield [*keys, reference, identity, measure, *numbers, adjusted]


def _known(results: Results, values: np.ndarray) -> Iterator[tuple[int, str]]:
    """Index and name of each object that has a value; "all" comes last."""
    names = [*map(str, results.object_ids), "all"]
    return ((place, name) for place, name in enumerate(names) if np.isfinite(values[place]))


def _parameters(results: Results) -> list[str]:
    """Names of all parameters, in the order of the configurations."""
    names = (name for c in results.configurations for name in c.parameters)
    return list(dict.fromkeys(names))


def _keys(results: Results, configuration: Configuration) -> list[Any]:
    values = [_cell(configuration.parameters.get(name)) for name in _parameters(results)]
    return [results.scene_name, configuration.method, configuration.ordering, *values]


def _cell(value: Any) -> Any:
    """Format an option's value for a CSV field."""
    return "" if value is None else plain(value) if isinstance(value, tuple) else value


def _number(value: float) -> str:
    return f"{value:.7g}" if np.isfinite(value) else ""
