"""Writes the report of an evaluation: one self-contained HTML file without scripts."""

import json
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2

from jaxpf.evaluation.figures import MOST_LINES, write_figures
from jaxpf.evaluation.measures import ON_OBJECT
from jaxpf.evaluation.summaries import Overview
from jaxpf.evaluation.tables import (
    MOST_PRINTED,
    SIGNIFICANT,
    calibration_tables,
    difference_tables,
    estimate_tables,
    score_tables,
)
from jaxpf.files.writing import write_text
from jaxpf.measures.intervals import DECISIVE

NAME = "report.html"


def write_report(overview: Overview) -> Path:
    """Write ``report.html`` and the figures into the evaluation's folder; return its path.

    Raises:
        InputError: a file cannot be written.
    """
    source = resources.files("jaxpf.evaluation").joinpath("report.html").read_text("utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.from_string(source).render(_content(overview))
    path = overview.results.folder / NAME
    write_text(path, text.lstrip())
    return path


def _content(overview: Overview) -> dict[str, Any]:
    """The values of the template."""
    results, best = overview.results, overview.ranked[:MOST_PRINTED]
    figures = write_figures(overview)
    tables = {
        "differences": difference_tables(overview),
        "calibration": calibration_tables(overview, best),
    }
    names = [name for name in ("differences", *figures) if name in figures or tables[name]]
    settings = {name: results.settings.get(name) for name in ("asked", "versions")}
    return {
        "results": results,
        "conclusion": overview.conclusion if overview.summaries else "",
        "best": overview.names[overview.ranking[0]] if overview.ranking else "",
        "remarks": overview.remarks,
        "estimates": estimate_tables(overview, best),
        "num_shown": len(best),
        "num_lines": min(len(overview.summaries), MOST_LINES),
        "num_configurations": len(overview.summaries),
        "scores": score_tables(overview, best),
        "sections": names,
        "figures": figures,
        "tables_of": tables,
        "on_object": ON_OBJECT,
        "significant": SIGNIFICANT,
        "decisive": DECISIVE,
        "settings": json.dumps(settings, indent=2, ensure_ascii=False),
    }
