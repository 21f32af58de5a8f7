"""Writes the report of an evaluation: one self-contained HTML file without scripts."""

import json
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from jaxpf.contract.errors import import_extra
from jaxpf.evaluation.measuring.overview import Overview
from jaxpf.evaluation.output.figures import Figure, write_figures
from jaxpf.evaluation.output.layout import (
    ABOUT_CALIBRATION,
    ABOUT_CONFIDENCE,
    ABOUT_DIFFERENCES,
    MOST_PRINTED,
    NOTES,
    calibration_tables,
    difference_tables,
    estimate_tables,
    score_tables,
)
from jaxpf.evaluation.output.tables import write_tables
from jaxpf.evaluation.work.results import Results
from jaxpf.files.tables import Table
from jaxpf.files.writing import write_text

NAME = "report.html"
_FILES = (
    "results.csv (every run), summary.csv, summary.md, curves.csv, differences.csv, figures/ (PNG "
    "and PDF)"
)


class _Section(NamedTuple):
    """A figure of the report, tables, or both, with a note on them."""

    name: str
    title: str
    figure: Figure | None
    tables: list[Table]
    note: str


def write_report(results: Results, overview: Overview | None = None) -> Path:
    """Write ``report.html`` and the figures into the evaluation's folder.

    Args:
        results: the evaluation, finished or not.
        overview: result of ``write_tables``, which is called by default.

    Returns:
        The report's path.

    Raises:
        InputError: a file cannot be written, a batch is damaged, or Jinja2 is not installed.
    """
    jinja2 = import_extra("jinja2", "writing a report needs Jinja2")
    overview = write_tables(results) if overview is None else overview
    source = resources.files("jaxpf.evaluation.output").joinpath("report.html").read_text("utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.from_string(source).render(_content(results, overview))
    path = results.folder / NAME
    write_text(path, text.lstrip())
    return path


def _content(results: Results, overview: Overview) -> dict[str, Any]:
    summaries, best, ids = overview.summaries, overview.ranked[:MOST_PRINTED], results.object_ids
    ranking = overview.ranking
    beside = {
        "calibration": (calibration_tables(ids, best), NOTES[ABOUT_CALIBRATION]),
        "confidence": ([], NOTES[ABOUT_CONFIDENCE]),
    }
    differences = difference_tables(ids, summaries)
    sections = [
        _Section("differences", "Paired differences", None, differences, NOTES[ABOUT_DIFFERENCES]),
        *(
            _Section(figure.name, figure.title, figure, *beside.get(figure.name, ([], "")))
            for figure in write_figures(results, overview)
        ),
    ]
    return {
        "results": results,
        "conclusion": overview.conclusion if summaries else "",
        "best": summaries[ranking[0]].name if ranking else "",
        "remarks": overview.remarks,
        "estimates": estimate_tables(ids, best),
        "num_configurations": len(summaries),
        "scores": score_tables(ids, best),
        "notes": NOTES,
        "sections": [section for section in sections if section.figure or section.tables],
        "settings": json.dumps(
            {name: results.settings.get(name) for name in ("asked", "versions")},
            indent=2,
            ensure_ascii=False,
        ),
        "files": _FILES,
    }
