"""The tables of an evaluation: files for programs, and texts for the terminal and the report.

``write_tables`` writes into the evaluation's folder

* ``results.csv``: one row per scene, method, ordering, parameters, seed, run and object;
* ``summary.csv``: one row per configuration, object ("all" for all objects) and measure;
* ``curves.csv``: success and precision curves of every configuration and object;
* ``differences.csv``: configurations minus their references, on common seeds.

Undefined fields, such as the precision of an object that was never tracked, are empty.  Readers'
tables have one row per configuration, with cells "value [lower, upper]".
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from jaxpf.contract.numbers import plain
from jaxpf.evaluation.estimates import ALL
from jaxpf.evaluation.measures import REGIONS, SCORES, SIZE_REGIONS, Measure, by_name
from jaxpf.evaluation.results import Results
from jaxpf.evaluation.summaries import Overview, measure_results
from jaxpf.files.writing import atomic_write
from jaxpf.measures.intervals import DECISIVE

#: Measures in the tables; ``summary.csv`` has all measures.
HEADLINE = (
    *("success_rate_50", "success_auc", "success", "recovered", "precision", "recall"),
    *("iou", "centre_error", "corner_error", "distinct_share", "frames_per_second"),
)
#: Measures that fit in a terminal of 120 columns.
PRINTED = (
    *("success_rate_50", "success_auc", "iou", "coverage_95", "size_coverage_95"),
    "frames_per_second",
)
#: Measures of the spread's calibration.  The log score is only in ``summary.csv``: one frame with
#: identical particles outweighs all others.
CALIBRATION = (
    *(f"coverage_{p}" for p in REGIONS),
    *(f"size_coverage_{p}" for p in SIZE_REGIONS),
    "crps",
)
#: Measures whose differences are shown.
COMPARED = ("success_rate_50", "success_auc", "success", "recovered", "centre_error")
#: Most configurations in the tables of the terminal and the report.
MOST_PRINTED = 10
#: A half-width below this is rounding error from equal values.
_ROUNDING = 1e-4
#: Differences with a Holm-adjusted p below this are marked.
SIGNIFICANT = 0.05


def write_tables(results: Results) -> Overview:
    """Measure the runs of an evaluation, finished or not, and write all tables.

    Raises:
        InputError: a file cannot be written, or a batch is damaged.
    """
    overview = measure_results(results)
    names = dict.fromkeys(name for c in results.configurations for name in c.parameters)
    keys = pd.DataFrame(
        [
            [results.scene_name, c.method, c.ordering, *(_cell(c.parameters.get(n)) for n in names)]
            for c in results.configurations
        ],
        columns=["scene", "method", "ordering", *names],
        dtype=str,
    )
    differences = overview.differences.rename(columns={"value": "difference"})
    differences["reference"] = [overview.names[index] for index in differences.reference]
    for name, table in (
        ("results", overview.runs),
        ("summary", overview.estimates),
        ("curves", overview.curves),
        ("differences", differences),
    ):
        own = keys.iloc[table.configuration].reset_index(drop=True)
        rest = table.drop(columns="configuration").reset_index(drop=True)
        write_csv(results.folder / f"{name}.csv", pd.concat([own, rest], axis=1))
    return overview


def _cell(value: object) -> str:
    """An option's value for a CSV field."""
    return "" if value is None else plain(value) if isinstance(value, tuple) else str(value)


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """Write a data frame with seven digits; undefined numbers are empty."""
    with atomic_write(path) as file:
        table.to_csv(file, index=False, float_format="%.7g", lineterminator="\n")


# Tables for readers: title -> a data frame of texts, with the configurations in its first column


def printed_tables(overview: Overview) -> dict[str, pd.DataFrame]:
    """The table for the terminal: all objects, the best configurations; none without results."""
    best = overview.ranked[:MOST_PRINTED]
    tables = [*estimate_tables(overview, best, PRINTED).items()][:1]
    if len(best) < len(overview.summaries):
        title = f"all objects: the best {len(best)} of {len(overview.summaries)} configurations"
        tables = [(title, table) for _, table in tables]
    return dict(tables)


def estimate_tables(
    overview: Overview,
    configurations: Sequence[int],
    measures: Sequence[str] = HEADLINE,
    about: str = "",
) -> dict[str, pd.DataFrame]:
    """Rates and means: a table of all objects, then one per object.

    Args:
        overview: of the evaluation.
        configurations: their indices.
        measures: in the columns; those without a value are left out.
        about: what the tables are about, for their titles.
    """
    runs = [overview.summaries[index].runs for index in configurations]
    tables = {}
    for title, of in _objects(overview.results) if runs else ():
        columns = {"method": [overview.names[index] for index in configurations]}
        if len(set(runs)) > 1:
            columns["runs"] = [*map(str, runs)]
        for measure in measures:
            values = intervals(overview.estimates, measure, of, configurations)
            columns |= measure_column(measure, values)
        tables[about + title] = pd.DataFrame(columns)
    return tables


def score_tables(overview: Overview, configurations: Sequence[int]) -> dict[str, pd.DataFrame]:
    """One table of standard scores over all objects; no table without TrackEval."""
    names = [measure.name for measure in SCORES]
    if not overview.estimates.measure.isin(names).any():
        return {}
    tables = estimate_tables(overview, configurations, names, "standard scores, ")
    return dict([*tables.items()][:1])


def calibration_tables(
    overview: Overview, configurations: Sequence[int]
) -> dict[str, pd.DataFrame]:
    """Calibration; no tables if no filter has spreads of x and y."""
    calibrated = [i for i in configurations if overview.summaries[i].pit_values.any()]
    return estimate_tables(overview, calibrated, CALIBRATION, "calibration, ")


def difference_tables(overview: Overview) -> dict[str, pd.DataFrame]:
    """Paired differences from the references: a table of all objects, then one per object."""
    found, names = overview.differences, overview.names
    references = found.groupby("configuration").reference.first()
    tables = {}
    for title, of in _objects(overview.results) if len(found) else ():
        columns = {
            "method": [names[index] for index in references.index],
            "compared with": [names[index] for index in references],
        }
        for measure in COMPARED:
            values = intervals(found, measure, of, references.index)
            rows = found[(found.measure == measure) & (found.object == of)]
            clear = rows[(rows.runs >= DECISIVE) & (rows.p_holm < SIGNIFICANT)].configuration
            stars = references.index.isin(clear)
            for heading, cells in measure_column(measure, values, sign="+").items():
                starred = zip(cells, stars, strict=True)
                texts = [f"{cell} *" if star else cell for cell, star in starred]
                columns[heading.replace("(%)", "(points)")] = texts
        tables[f"{title}: differences on common seeds"] = pd.DataFrame(columns)
    return tables


def _objects(results: Results) -> Iterator[tuple[str, str]]:
    """Title and name in the tables of all objects and of each; of one object, only of that."""
    if len(results.object_ids) > 1:
        yield "all objects", ALL
    for identity in results.object_ids:
        yield f"object {identity}", str(identity)


def intervals(
    table: pd.DataFrame, measure: str, of: str, configurations: Sequence[int]
) -> np.ndarray:
    """Value, lower and upper end ``[C, 3]`` of a measure and an object; NaN where there is none."""
    rows = table[(table.measure == measure) & (table.object == of)].set_index("configuration")
    return rows.reindex(configurations)[["value", "lower", "upper"]].to_numpy()


def measure_column(name: str, values: np.ndarray, sign: str = "") -> dict[str, list[str]]:
    """Heading and cells of a measure with the triples ``[C, 3]``; nothing if it has no value."""
    if not np.isfinite(values[:, 0]).any():
        return {}
    measure = by_name(name)
    return {heading_of(measure): cells_of(measure, values, sign)}


def heading_of(measure: Measure) -> str:
    """Title and unit of a measure, and whether it is a median over the units."""
    unit = "%" if measure.percent else measure.unit
    about = ", ".join(filter(None, [unit, "" if measure.bounds else "median"]))
    return f"{measure.title} ({about})" if about else measure.title


def cells_of(measure: Measure, values: np.ndarray, sign: str = "") -> list[str]:
    """Format triples ``[C, 3]`` as "value [lower, upper]" with a common number of decimals.

    The number is chosen so that the typical half-width of an interval is 3 to 30 units of the last
    digit.
    """
    values = values * (100 if measure.percent else 1)
    reach = (values[:, 2] - values[:, 1]) / 2
    widths = reach[np.isfinite(reach) & (reach > _ROUNDING)]
    typical = float(np.median(widths)) if len(widths) else math.nan
    decimals = 1 if math.isnan(typical) else min(max(-math.floor(math.log10(typical / 3)), 0), 4)

    def number(value: float, sign: str = "") -> str:
        # Adding 0 turns -0 into 0.
        return f"{round(value, decimals) + 0:{sign}.{decimals}f}"

    texts = []
    for value, lower, upper in values:
        text = number(value, sign) if np.isfinite(value) else "-"
        ends = number(lower), number(upper)
        if np.isfinite([value, lower, upper]).all() and (sign or ends[0] != ends[1]):
            text += f" [{ends[0]}, {ends[1]}]"
        texts.append(text)
    return texts
