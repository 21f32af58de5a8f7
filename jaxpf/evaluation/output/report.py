"""Writes the report of an evaluation: one self-contained HTML file without scripts."""

import base64
import struct
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.output.figures import Figure, write_figures
from jaxpf.evaluation.output.layout import (
    ABOUT_CALIBRATION,
    ABOUT_CONFIDENCE,
    ABOUT_DIFFERENCES,
    HEADLINE,
    NOTES,
    calibration_tables,
    difference_tables,
    estimate_tables,
    reliability_tables,
    score_tables,
)
from jaxpf.evaluation.output.tables import Tables, write_tables
from jaxpf.evaluation.results import Results
from jaxpf.files.tables import Table
from jaxpf.files.writing import write_text

NAME = "report.html"
_FILES = (
    "results.csv (every run), summary.csv, summary.md, curves.csv, differences.csv, figures/ (PNG "
    "and PDF)"
)


#: Order of the sections.
_ORDER = (
    "overlaps",
    "differences",
    "success-curves",
    "error-over-time",
    "calibration",
    "confidence",
    "against-time",
)


class _Section(NamedTuple):
    """A figure of the report, with its tables and a note on them."""

    name: str
    title: str
    figure: dict[str, Any]
    tables: list[Table]
    note: str


def write_report(results: Results, tables: Tables | None = None) -> Path:
    """Write ``report.html`` and the figures into the evaluation's folder.

    Args:
        results: the evaluation, finished or not.
        tables: result of ``write_tables``, which is called by default.

    Returns:
        The report's path.

    Raises:
        InputError: a file cannot be written, a batch is damaged, or Jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, StrictUndefined
    except ModuleNotFoundError:
        raise InputError("writing a report needs Jinja2; pip install 'jaxpf[cli]'") from None
    tables = write_tables(results) if tables is None else tables
    figures = write_figures(results, tables)
    source = resources.files("jaxpf.evaluation.output").joinpath("report.html").read_text("utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.from_string(source).render(_content(results, tables, figures))
    path = results.folder / NAME
    write_text(path, text.lstrip())
    return path


def _content(results: Results, tables: Tables, figures: Sequence[Figure]) -> dict[str, Any]:
    summaries, ids = tables.summaries, results.object_ids
    places = [len(ids), *range(len(ids))]
    best = tables.best_first()
    sections = [
        _Section(
            "differences",
            "Paired differences",
            {},
            difference_tables(ids, summaries, places),
            NOTES[ABOUT_DIFFERENCES],
        )
    ]
    beside = {
        "calibration": (calibration_tables(ids, best, places), ABOUT_CALIBRATION),
        "confidence": (reliability_tables(best), ABOUT_CONFIDENCE),
    }
    for figure in figures:
        shown, note = beside.get(figure.name, ([], None))
        sections.append(
            _Section(
                figure.name,
                figure.title,
                _embedded(figure),
                shown,
                "" if note is None else NOTES[note],
            )
        )
    sections = [section for section in sections if section.figure or section.tables]
    sections.sort(key=lambda section: _ORDER.index(section.name))
    lead = (
        _counted(len(summaries), "configuration"),
        f"{_counted(results.runs, 'run')} each",
        _counted(len(ids), "object"),
        f"{_counted(len(results.truth), 'frame')} after the start frame",
    )
    return {
        "title": f"Evaluation: {results.scene_name}",
        "lead": ", ".join(lead),
        "conclusion": tables.conclusion.sentence if summaries else "",
        "best": summaries[tables.conclusion.ranking[0]].name if tables.conclusion.ranking else "",
        "remarks": tables.remarks,
        "estimates": estimate_tables(ids, best, places, HEADLINE),
        "num_configurations": len(summaries),
        "scores": score_tables(best, len(ids)),
        "notes": NOTES,
        "sections": sections,
        "settings": list(_settings(results)),
        "files": _FILES,
    }


def _embedded(figure: Figure) -> dict[str, Any]:
    data = figure.png.read_bytes()
    width, height = struct.unpack(">II", data[16:24])  # from the PNG header
    return {
        "title": figure.title,
        "caption": figure.caption,
        "data": f"data:image/png;base64,{base64.b64encode(data).decode('ascii')}",
        # Drawn at 130 pixels per inch, shown at 96.
        "width": round(width * 96 / 130),
        "height": round(height * 96 / 130),
    }


def _settings(results: Results) -> Iterator[tuple[str, str]]:
    """Yield names and values of settings; nested names include their path."""
    settings = results.settings
    yield "scene", results.scene_name
    yield "objects", ", ".join(map(str, results.object_ids))
    yield "start frame", f"{results.start_frame} (counted from 0)"
    yield "frames", f"{len(results.truth)} after the start frame, {results.fps:g} per second"
    yield "runs", f"{results.runs} per configuration"
    yield from _flattened("", settings.get("asked", {}))
    versions = settings.get("versions", {})
    yield "versions", "; ".join(f"{name} {version}" for name, version in versions.items())


def _flattened(name: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _flattened(f"{name} {key}".strip(), entry)
    elif isinstance(value, list | tuple):
        yield (
            name,
            "; ".join(
                ", ".join(map(str, entry)) if isinstance(entry, list | tuple) else str(entry)
                for entry in value
            ),
        )
    elif value is not None:
        yield name, str(value)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" + "s" * (number != 1)
