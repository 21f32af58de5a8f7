"""Writes the report of an evaluation: one self-contained HTML file without scripts."""

import base64
import struct
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.output.clips import SIZES, make_clip, read_pictures
from jaxpf.evaluation.output.figures import Figure, write_figures
from jaxpf.evaluation.output.layout import (
    NOTES,
    PRINTED,
    Table,
    calibration_tables,
    difference_tables,
    equal_time_tables,
    estimate_tables,
    object_name,
    score_tables,
)
from jaxpf.evaluation.output.tables import Tables, best_first, write_tables
from jaxpf.evaluation.results import Results
from jaxpf.evaluation.summary import Summary
from jaxpf.files.writing import write_text

NAME = "report.html"
#: Limit on the total bytes of clips; base64 in the file adds a third.
CLIP_BYTES = 9_000_000
_MOST_SHOWN = 4

_FILES = (
    "results.csv (every run), summary.csv, summary.md and summary.tex, curves.csv, "
    "differences.csv, tracks/ (best, median and worst run of every configuration, MOT format), "
    "figures/ (PNG and PDF)"
)


class _Section(NamedTuple):
    name: str
    title: str
    figures: list[dict[str, Any]]
    tables: list[Table]


def write_report(results: Results, tables: Tables | None = None) -> Path:
    """Write ``report.html`` and the figures into the evaluation's folder.

    Args:
        results: the evaluation, finished or not; without its scene the report has no clips.
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
    places = [len(ids), tables.hardest, *range(len(ids))]
    sections = list(
        _sections(
            figures,
            {
                "differences": difference_tables(ids, summaries, places),
                "against-time": equal_time_tables(ids, summaries, places),
                "calibration": calibration_tables(ids, summaries, places),
            },
        )
    )
    leading = estimate_tables(
        ids, best_first(summaries, tables.conclusion.ranking), [len(ids)], PRINTED
    )
    groups, clips_remark = _clips(results, tables)
    contents = [("summary", "Summary")] if summaries else []
    contents += [(section.name, section.title) for section in sections]
    contents += [("clips", "Clips"), ("settings", "Settings")]
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
        "leading": leading,
        "num_configurations": len(summaries),
        "finding": _finding(results, tables),
        "remarks": tables.remarks,
        "contents": contents,
        "estimates": estimate_tables(ids, summaries, places),
        "shown_tables": min(len(ids), 2),
        "scores": score_tables(summaries, len(ids)),
        "notes": NOTES,
        "sections": sections,
        "clips": groups,
        "clips_remark": clips_remark,
        "settings": list(_settings(results)),
        "files": _FILES,
    }


def _finding(results: Results, tables: Tables) -> str:
    """State the hardest object's range of success over the configurations."""
    ours = [s for s in tables.summaries if not s.configuration.is_imported]
    shares = [s.estimates["success_half"].value[tables.hardest] for s in ours]
    if len(ours) < 2 or not np.isfinite(shares).all():
        return ""
    low, high = int(np.argmin(shares)), int(np.argmax(shares))
    if shares[low] == shares[high]:
        return ""
    which = object_name(results.object_ids, tables.hardest)
    which = f"{which}, recovered least of all objects," if len(results.object_ids) > 1 else which
    return (
        f"Over the configurations, the overlap of {which} exceeded .5 in "
        f"{100 * shares[low]:.0f}\u00a0% ({ours[low].name}) to "
        f"{100 * shares[high]:.0f}\u00a0% ({ours[high].name}) of the frames. The "
        "paired differences below show which of these chance explains."
    )


def _sections(figures: Sequence[Figure], tables: Mapping[str, list[Table]]) -> Iterator[_Section]:
    """Yield one section per kind of figure; figures of the error over time share one."""
    embedded = {figure.name: _embedded(figure) for figure in figures}
    over_time = [embedded[name] for name in embedded if name.startswith("error-over-time")]
    for name, title in (
        ("overlaps", "Success at .5 and success area"),
        ("rates", "Success and recovery of smith2004"),
        ("differences", "Paired differences"),
        ("diversity", "Uniqueness and effective dynamics"),
        ("against-time", "Accuracy against time"),
        ("calibration", "Calibration"),
        ("error-over-time", "Centre error over time"),
        ("success-curves", "Success curves"),
    ):
        found = over_time if name == "error-over-time" else [embedded.get(name)]
        if any(found):
            shown = [figure for figure in found if figure]
            yield _Section(name, title, shown, tables.get(name, []))


def _embedded(figure: Figure) -> dict[str, Any]:
    data = figure.png.read_bytes()
    width, height = struct.unpack(">II", data[16:24])  # from the PNG header
    return {
        "title": figure.title,
        "caption": figure.caption,
        "data": _data_uri("image/png", data),
        # Drawn at 130 pixels per inch, shown at 96.
        "width": round(width * 96 / 130),
        "height": round(height * 96 / 130),
    }


def _clips(results: Results, tables: Tables) -> tuple[list[dict[str, Any]], str]:
    """Clips by configuration, and a remark on them."""
    if not tables.summaries:
        return [], "No run is finished."
    sizes = list(SIZES)
    try:
        frames = results.scene().frames[1:]
        if len(frames) != len(results.truth):
            return [], "Without clips: the scene has changed since the evaluation."
        pictures = read_pictures(frames, sizes[0])
    except ValueError as error:  # the scene's folder may have been removed since the runs
        return [], f"Without clips: {error}"
    groups: list[dict[str, Any]] = []
    total, step, chosen = 0, 1, _chosen(tables)
    number = sum(len(summary.shown) for summary in chosen)
    for summary in chosen:
        clips: list[dict[str, Any]] = []
        for shown in summary.shown:
            given = (results.truth, shown, results.adapter, results.start)
            while True:
                clip = make_clip(pictures, *given, results.start_frame + 1, results.fps)
                # The first clip predicts the size of all: retry smaller if it is too large.
                if len(sizes) == 1 or groups or clips or number * len(clip.data) <= CLIP_BYTES:
                    break
                sizes.pop(0)
                pictures = read_pictures(frames, sizes[0])
            total, step = total + len(clip.data), clip.step
            clips.append(
                {
                    "data": _data_uri("video/webm", clip.data),
                    "width": clip.width,
                    "height": clip.height,
                    "caption": f"{shown.role.replace('-', ', ').capitalize()} (run {shown.run}): "
                    f"mean overlap {100 * shown.overlap:.1f} %; {clip.rate:.3g} frames a second",
                }
            )
        if groups and total > CLIP_BYTES:
            break
        groups.append({"name": summary.name, "clips": clips})
    remark = (
        "Runs are ranked by their mean overlap over all objects and frames. White: the truth. In "
        "colour, with numbers: the estimates; dashed where no particle had any likelihood. Frames "
        "are counted from 0. "
    )
    if step > 1:
        remark += f"One frame in {step} is shown. "
    if len(groups) < len(tables.summaries):
        remark += (
            f"Shown are {len(groups)} of {len(tables.summaries)} configurations: the best, the "
            "worst, and the first of other methods; tracks/ has the runs of all."
        )
    return groups, remark.strip()


def _chosen(tables: Tables) -> list[Summary]:
    """Choose configurations to show: all if few, else the best, the worst, and other methods."""
    summaries = tables.summaries
    if len(summaries) <= _MOST_SHOWN:
        return summaries
    quality = [s.estimates["success_area"].value[-1] for s in summaries]
    order = sorted(range(len(summaries)), key=lambda index: quality[index])
    wanted = [order[-1], order[0]]
    for index, summary in enumerate(summaries):
        shown = {summaries[other].configuration.method for other in wanted}
        if len(wanted) < _MOST_SHOWN and summary.configuration.method not in shown:
            wanted.append(index)
    return [summaries[index] for index in sorted(set(wanted))]


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


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
