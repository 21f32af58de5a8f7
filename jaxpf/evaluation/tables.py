"""Tables of an evaluation: every run, the summary over runs, and tracks of chosen runs.

``write_tables`` writes into the evaluation's folder

* ``results.csv``: one row per scene, method, ordering, parameters, seed, run and object, which
  ``pandas.read_csv`` reads as it is;
* ``summary.csv``: one row per configuration, object ("all" for all of them) and measure;
* ``differences.csv``: configurations against their references, on common seeds;
* ``summary.md`` and ``summary.tex``: what a paper shows of them;
* ``tracks/``: the best, the median and the worst run of each configuration in MOT format, and
  the truth.

Fields of a table that do not exist, such as the precision of an object that was never tracked,
are empty.
"""

import contextlib
import csv
import dataclasses
import io
import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from jaxpf.evaluation.batches import Batch
from jaxpf.evaluation.collection import Collected, Curve, ShownRun, collect
from jaxpf.evaluation.layout import (
    PRINTED,
    Table,
    difference_tables,
    estimate_tables,
    to_latex,
    to_markdown,
)
from jaxpf.evaluation.measures import COLUMNS, MEASURES, Measure
from jaxpf.evaluation.results import Configuration, Results
from jaxpf.evaluation.summary import (
    Difference,
    Estimate,
    holm,
    mean,
    mean_difference,
    rate,
    rate_difference,
    without_interval,
)
from jaxpf.files import atomic_write, report_os_errors
from jaxpf.tracks import write_mot

_KEYS = ("scene", "method", "ordering")
_NUMBERS = ",".join(["%.7g"] * len(COLUMNS))


@dataclasses.dataclass(frozen=True)
class Summary:
    """What the runs of one configuration say.

    Attributes:
        configuration: whose runs these are.
        name: of the configuration, with the parameters that vary.
        runs: finished runs.
        estimates: for each measure; ``[P + 1]``, all objects last.
        reference: index among the summaries of the one it is compared with, or None.
        differences: from the reference, for each measure.
        adjusted: Holm's p of each difference, ``[P + 1]``: the family is all comparisons of one
            measure and object.
        quantiles: of the centre error, ``[5, T, P + 1]``.
        curve: success curves.
        shown: the best, the median and the worst run.
    """

    configuration: Configuration
    name: str
    runs: int
    estimates: dict[str, Estimate]
    reference: int | None
    differences: dict[str, Difference]
    adjusted: dict[str, np.ndarray]
    quantiles: np.ndarray
    curve: Curve
    shown: list[ShownRun]


@dataclasses.dataclass(frozen=True)
class Tables:
    """What ``write_tables`` found.

    Attributes:
        summaries: of every configuration with finished runs.
        remarks: sentences about what is missing or to be read with care.
        hardest: index of the object that was recovered least, over all configurations.
        printed: the tables that a terminal shows.
    """

    summaries: list[Summary]
    remarks: list[str]
    hardest: int
    printed: list[Table]


def write_tables(results: Results) -> Tables:
    """Write all tables of an evaluation, finished or not, in memory that runs do not add to.

    Raises:
        InputError: a file cannot be written; a batch is damaged.
    """
    configurations = results.configurations
    with report_os_errors("write into", results.folder):
        scratch = tempfile.TemporaryDirectory(dir=results.folder, prefix=".tables-")
    with scratch as store, atomic_write(results.folder / "results.csv") as file:
        writer = _RowWriter(file, results)
        collected: list[Collected] = []
        for index, configuration in enumerate(configurations):
            folder = Path(store) / f"{index}"
            folder.mkdir()
            rows = writer.for_configuration(configuration)
            if (found := collect(results, configuration, folder, rows)) is not None:
                collected.append(found)
        summaries = _summarise(results, collected)
    hardest = _hardest(summaries, len(results.object_ids))
    remarks = _remarks(results, summaries)
    _write_summary(results, summaries)
    _write_differences(results, summaries)
    ids = results.object_ids
    places = [len(ids), *range(len(ids))]
    everything = [
        *estimate_tables(ids, summaries, places),
        *difference_tables(ids, summaries, places),
    ]
    title = f"{results.scene_name}, {results.runs} runs"
    for suffix, render in ((".md", to_markdown), (".tex", to_latex)):
        with atomic_write(results.folder / f"summary{suffix}") as file:
            file.write(render(title, everything, remarks))
    _write_tracks(results, summaries)
    printed = [
        *estimate_tables(ids, summaries, [len(ids), hardest], PRINTED),
        *difference_tables(ids, summaries, [hardest]),
    ]
    return Tables(summaries, remarks, hardest, printed)


class _RowWriter:
    """Rows of ``results.csv``, written as the batches come."""

    def __init__(self, file: IO[str], results: Results):
        self._file, self._results = file, results
        header = [*_KEYS, *_parameters(results), "seed", "run", "object", *COLUMNS]
        file.write(_csv_line(header) + "\n")

    def for_configuration(self, configuration: Configuration) -> Any:
        results, file = self._results, self._file
        prefix = _csv_line(_keys(results, configuration))
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


def _summarise(results: Results, collected: Sequence[Collected]) -> list[Summary]:
    references = _references(collected)
    estimates: list[dict[str, Estimate]] = [{} for _ in collected]
    differences: list[dict[str, Difference]] = [{} for _ in collected]
    adjusted: list[dict[str, np.ndarray]] = [{} for _ in collected]
    for measure in MEASURES:
        for index, entry in enumerate(collected):
            estimates[index][measure.name] = _estimate(entry, measure)
            if (reference := references[index]) is not None:
                found = _difference(entry, collected[reference], measure)
                differences[index][measure.name] = found
        compared = [index for index in range(len(collected)) if references[index] is not None]
        if compared:
            p = np.stack([differences[index][measure.name].p for index in compared])
            family = np.stack([holm(column) for column in p.T], axis=1)
            for index, row in zip(compared, family, strict=True):
                adjusted[index][measure.name] = row
    return [
        Summary(
            configuration=entry.configuration,
            name=configuration_name(results, entry.configuration),
            runs=len(entry.runs),
            estimates=estimates[index],
            reference=references[index],
            differences=differences[index],
            adjusted=adjusted[index],
            quantiles=entry.quantiles,
            curve=entry.curve,
            shown=entry.shown,
        )
        for index, entry in enumerate(collected)
    ]


def configuration_name(results: Results, configuration: Configuration) -> str:
    """Method, ordering, and the parameters that differ between configurations."""
    varied = [
        f"{name} {_plain(configuration.parameters[name])}"
        for name in results.varied
        if name in configuration.parameters
    ]
    return ", ".join([configuration.label, *varied])


def _plain(value: float | int | str) -> str:
    return f"{value:g}" if isinstance(value, float) else f"{value}"


def _references(collected: Sequence[Collected]) -> list[int | None]:
    """What each configuration is compared with; None if nothing shares seeds with it.

    It is the first configuration with the same parameters; and for that one, the first of all:
    methods are compared at equal parameters, and parameters with the first method.
    """
    references: list[int | None] = []
    for index, entry in enumerate(collected):
        candidates = [
            other
            for other in range(index)
            if not collected[other].configuration.is_imported
            and len(np.intersect1d(collected[other].runs, entry.runs)) > 1
        ]
        same = [
            other
            for other in candidates
            if collected[other].configuration.parameters == entry.configuration.parameters
        ]
        chosen = (same or candidates)[:1]
        references.append(chosen[0] if chosen and not entry.configuration.is_imported else None)
    return references


def _estimate(entry: Collected, measure: Measure) -> Estimate:
    values = entry.column(measure.name)
    found = rate(values) if measure.is_rate else mean(values, _weights(entry, measure, values))
    return without_interval(found) if entry.configuration.is_imported else found


def _difference(entry: Collected, reference: Collected, measure: Measure) -> Difference:
    _, ours, theirs = np.intersect1d(entry.runs, reference.runs, return_indices=True)
    values, other = entry.column(measure.name), reference.column(measure.name)
    if measure.is_rate:
        return rate_difference(values[ours], other[theirs])
    return mean_difference(
        *(values[ours], _weights(entry, measure, values)[ours]),
        *(other[theirs], _weights(reference, measure, other)[theirs]),
    )


def _weights(entry: Collected, measure: Measure, values: np.ndarray) -> np.ndarray:
    return entry.column(measure.weight) if measure.weight else np.ones_like(values)


def _hardest(summaries: Sequence[Summary], num_objects: int) -> int:
    """The object with the lowest mean recovery; of equal ones, the lowest overlap."""
    if not summaries:
        return 0
    recovery, overlap = (
        np.mean([summary.estimates[name].value[:num_objects] for summary in summaries], axis=0)
        for name in ("recovered", "overlap")
    )
    # An object without truth has no rate, and is not hard.
    order = np.lexsort((np.nan_to_num(overlap, nan=2), np.nan_to_num(recovery, nan=2)))
    return int(order[0])


def _remarks(results: Results, summaries: Sequence[Summary]) -> list[str]:
    remarks = []
    finished = {summary.name: summary.runs for summary in summaries}
    for configuration in results.configurations:
        name = configuration_name(results, configuration)
        runs = finished.get(name, 0)
        if configuration.is_imported:
            remarks.append(f"{name}: imported tracks, the same for every seed; without intervals.")
        elif runs < results.runs:
            remarks.append(f"{name}: {runs} of {results.runs} runs are finished.")
    return remarks


def _write_summary(results: Results, summaries: Iterable[Summary]) -> None:
    fields = ("runs", "value", "standard_error", "lower", "upper")
    header = [*_KEYS, *_parameters(results), "object", "measure", *fields]
    with _csv_writer(results.folder / "summary.csv", header) as rows:
        for summary in summaries:
            for measure, found in summary.estimates.items():
                for place, identity in enumerate(_objects(results)):
                    numbers = [_number(getattr(found, field)[place]) for field in fields]
                    rows.writerow(
                        [*_keys(results, summary.configuration), identity, measure, *numbers]
                    )


def _write_differences(results: Results, summaries: Sequence[Summary]) -> None:
    fields = ("runs", "value", "standard_error", "lower", "upper", "gained", "lost", "p")
    names = ("runs", "difference", *fields[2:], "p_holm")
    header = [*_KEYS, *_parameters(results), "reference", "object", "measure", *names]
    with _csv_writer(results.folder / "differences.csv", header) as rows:
        for summary in summaries:
            if summary.reference is None:
                continue
            keys = _keys(results, summary.configuration)
            for measure, found in summary.differences.items():
                for place, identity in enumerate(_objects(results)):
                    numbers = [_number(getattr(found, field)[place]) for field in fields]
                    adjusted = _number(summary.adjusted[measure][place])
                    reference = summaries[summary.reference].name
                    rows.writerow([*keys, reference, identity, measure, *numbers, adjusted])


def _write_tracks(results: Results, summaries: Sequence[Summary]) -> None:
    folder = results.folder / "tracks"
    with report_os_errors("create the folder", folder):
        folder.mkdir(exist_ok=True)
        for path in folder.glob("*-run*.txt"):  # other runs may have been best before
            path.unlink()
    ids = np.asarray(results.object_ids)

    def write(name: str, boxes: np.ndarray, lost: np.ndarray) -> None:
        frames = results.start_frame + 1 + np.arange(len(boxes))
        write_mot(
            folder / name,
            np.repeat(frames, len(ids)),
            np.tile(ids, len(frames)),
            boxes.reshape(-1, 4),
            1 - lost.reshape(-1).astype(int),
        )

    write("truth.txt", results.truth, np.zeros(results.truth.shape[:2], bool))
    for number, summary in enumerate(summaries, start=1):
        slug = re.sub(r"[^A-Za-z0-9.]+", "-", summary.name).strip("-.")
        for shown in summary.shown:
            name = f"{number:02d}-{slug}-{shown.role}-run{shown.run}.txt"
            write(name, shown.boxes, shown.lost)


@contextlib.contextmanager
def _csv_writer(path: Path, header: Sequence[str]) -> Iterator[Any]:
    with atomic_write(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        yield writer


def _objects(results: Results) -> list[str]:
    return [*map(str, results.object_ids), "all"]


def _parameters(results: Results) -> list[str]:
    """Names of all parameters, in the order in which configurations have them."""
    names = (name for c in results.configurations for name in c.parameters)
    return list(dict.fromkeys(names))


def _keys(results: Results, configuration: Configuration) -> list[Any]:
    values = [configuration.parameters.get(name, "") for name in _parameters(results)]
    return [results.scene_name, configuration.method, configuration.ordering, *values]


def _number(value: float) -> str:
    return f"{value:.7g}" if np.isfinite(value) else ""


def _csv_line(fields: Iterable[Any]) -> str:
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow(list(fields))
    return line.getvalue()
