"""Lays out readable tables: one row per configuration, with cells "value [lower, upper]"."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from jaxpf.evaluation.measuring.collection import Summary
from jaxpf.evaluation.measuring.estimates import Difference, Estimate
from jaxpf.evaluation.measuring.measures import (
    COMPARED,
    ON_OBJECT,
    REGIONS,
    SCORES,
    SIZE_REGIONS,
    Measure,
    by_name,
)
from jaxpf.files.tables import Rows, Table, escaped, markdown_table
from jaxpf.measures.intervals import DECISIVE

#: Measures in the tables; ``summary.csv`` has all measures.
HEADLINE = tuple(
    by_name(name)
    for name in (
        *("success_rate_50", "success_auc", "success", "recovered", "precision", "recall"),
        *("iou", "centre_error", "corner_error", "distinct_share", "frames_per_second"),
    )
)
#: Most configurations in the tables of the terminal and the report.
MOST_PRINTED = 10
#: Measures that fit in a terminal of 120 columns.
PRINTED = tuple(
    by_name(name)
    for name in (
        *("success_rate_50", "success_auc", "iou", "coverage_95", "size_coverage_95"),
        "frames_per_second",
    )
)
#: Measures of the spread's calibration.  The log score is only in ``summary.csv``: one frame with
#: identical particles outweighs all others.
CALIBRATION = tuple(
    by_name(name)
    for name in (
        *(f"coverage_{p}" for p in REGIONS),
        *(f"size_coverage_{p}" for p in SIZE_REGIONS),
        "crps",
    )
)
#: A half-width below this is rounding error from equal values.
_ROUNDING = 1e-4
#: Characters that Markdown would read as markup.
_SPECIAL = "\\`*_{}<>|#"
#: Differences with a Holm-adjusted p below this are marked.
SIGNIFICANT = 0.05

#: Indices of the notes.
ABOUT_MEASURES, ABOUT_DIFFERENCES, ABOUT_CALIBRATION, ABOUT_CONFIDENCE = range(1, 5)
NOTES = (
    "Values with 95% intervals in brackets. Runs are the independent units: frames and objects of "
    "a run add to the value, not to the certainty. Shares and rates are means over runs, with "
    "Clopper and Pearson's interval, of shares for as many trials as their spread is worth (Korn "
    "and Graubard 1998); below six runs it is too wide rather than too narrow. Errors and counts "
    "have no bound, so a few lost runs may dominate their mean: shown is the median over runs, "
    "with order statistics as its interval. Without brackets, the runs are too few: three are "
    "needed, of a median six.",
    "IoU is intersection over union. Success at IoU 0.5: the share of frames whose IoU exceeds "
    "0.5. Success AUC: the mean of that share over all thresholds from 0 to 1 (Wu, Lim and Yang "
    "2013). Smith2004's success and recovery ask for one shared pixel only, in every frame of a "
    "run or in its last one with truth, and do not say how well a box fits. Precision and recall "
    "are over the frames that share a pixel, the others over all frames with truth. The start "
    "frame never counts.",
    "Differences are paired by run: equal seeds share their random numbers. Shares: the mean "
    "difference, with the interval of a mean; rates: with one that excludes 0 where McNemar's "
    "exact test does. Errors: the median difference, with order statistics. p belongs to the same "
    "interval: below 0.05 the 95% interval excludes 0. A star marks "
    f"p < {SIGNIFICANT} after Holm's correction over the comparisons in its column; of fewer than "
    f"{DECISIVE} runs nothing is marked. Points are percentage points.",
    "Calibration: how often the 50, 80 and 95% regions of x and of y, and those of a box's size "
    "(the square root of its area), cover the truth. A region is as wide as the particles' standard"
    " deviation and the model's declared error say (of points the slip, of learned boxes 0.3 in the"
    " logarithm of the size), as in tracks.csv. Only frames in which the object is tracked (a "
    "shared pixel) count, because no region covers a lost object. CRPS, in pixels, is small where "
    "intervals are calibrated and narrow (Gneiting and Raftery 2007); the log score is in "
    "summary.csv.",
    "Confidence: share of the boxes on their object, by the confidence that was reported with "
    f"them. A box is on its object if their IoU is at least {ON_OBJECT:g}; all frames with "
    "truth count. The area under the curve is the probability that a box on its object has more "
    "confidence than one that is not, over all runs and objects. Off in silence: share of all "
    "frames with a box off its object that is not reported lost.",
    "Frames/s: a single run on this machine, from a frame in memory to its estimate, without "
    "compilation. It is the median over some frames; for trackers that return all boxes at once, "
    "the mean over all frames. Settings that share a compiled kernel share the figure.",
)


def estimate_tables(
    object_ids: Sequence[int],
    summaries: Sequence[Summary],
    measures: Sequence[Measure] = HEADLINE,
    about: str = "",
) -> list[Table]:
    """Rates and means: a table of all objects, then one per object.

    Args:
        object_ids: ids of the P objects.
        summaries: of the configurations.
        measures: in the columns; those without a value are left out.
        about: what the tables are about, for their titles.
    """
    tables = []
    for place in _places(object_ids) if summaries else ():
        rows: Rows = [(summary.name, []) for summary in summaries]
        table = Table("estimates", f"{about}{object_name(object_ids, place)}", ["method"], rows)
        if len({summary.runs for summary in summaries}) > 1:
            table.add("runs", [f"{summary.runs}" for summary in summaries])
        for measure in measures:
            values = triples([summary.estimates[measure.name] for summary in summaries], place)
            if are_known(values):
                table.add(heading(measure), cells_of(measure, values))
        tables.append(table)
    return tables


def score_tables(object_ids: Sequence[int], summaries: Sequence[Summary]) -> list[Table]:
    """One table of standard scores over all objects; no table without TrackEval."""
    if not any(SCORES[0].name in summary.estimates for summary in summaries):
        return []
    return estimate_tables(object_ids, summaries, SCORES, "standard scores, ")[:1]


def calibration_tables(object_ids: Sequence[int], summaries: Sequence[Summary]) -> list[Table]:
    """Calibration; no tables if no filter has spreads of x and y."""
    calibrated = [s for s in summaries if s.pit_values.any()]
    return estimate_tables(object_ids, calibrated, CALIBRATION, "calibration, ")


def difference_tables(object_ids: Sequence[int], summaries: Sequence[Summary]) -> list[Table]:
    """Paired differences from the references: a table of all objects, then one per object."""
    compared = [summary for summary in summaries if summary.reference is not None]
    tables = []
    for place in _places(object_ids) if compared else ():
        title = f"{object_name(object_ids, place)}: differences on common seeds"
        table = Table("differences", title, ["method"], [(each.name, []) for each in compared])
        table.add("compared with", [summaries[each.reference or 0].name for each in compared])
        for measure in COMPARED:
            values = triples([each.differences[measure.name] for each in compared], place)
            if are_known(values):
                clear = (_is_clear(each, measure.name, place) for each in compared)
                texts = zip(cells_of(measure, values, sign="+"), clear, strict=True)
                starred = (f"{text} *" if star else text for text, star in texts)
                table.add(heading(measure).replace("(%)", "(points)"), starred)
        tables.append(table)
    return tables


def _is_clear(summary: Summary, measure: str, place: int) -> bool:
    """Whether a difference gets a star."""
    found = summary.differences[measure]
    return bool(found.runs[place] >= DECISIVE and found.p_holm[place] < SIGNIFICANT)


def object_name(object_ids: Sequence[int], place: int) -> str:
    """Name of an object in tables and figures."""
    return "all objects" if place == len(object_ids) else f"object {object_ids[place]}"


def _places(object_ids: Sequence[int]) -> list[int]:
    """Indices of all objects (P) and of each; with one object, "all objects" is that object."""
    count = len(object_ids)
    return [0] if count == 1 else [count, *range(count)]


def triples(estimates: Sequence[Estimate | Difference], place: int) -> np.ndarray:
    """Value and interval ends ``[C, 3]`` of the object at ``place`` in C configurations."""
    return np.array([[x[place] for x in (e.value, e.lower, e.upper)] for e in estimates])


def are_known(values: np.ndarray) -> bool:
    """Whether any of ``triples`` has a value; columns without values are left out."""
    return bool(np.isfinite(values[:, 0]).any())


def heading(measure: Measure) -> str:
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


def to_markdown(
    title: str, tables: Iterable[Table], remarks: Iterable[str], notes: Iterable[str] = NOTES
) -> str:
    """A Markdown document with all tables."""
    parts = [f"# {_markdown(title)}", *(_markdown(note) for note in notes)]
    parts += [f"- {_markdown(remark)}" for remark in remarks]
    for table in tables:
        lines = markdown_table(table.columns, table.texts(), _SPECIAL)
        parts += [f"## {_markdown(table.title)}", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def _markdown(text: str) -> str:
    return escaped(text, _SPECIAL)
