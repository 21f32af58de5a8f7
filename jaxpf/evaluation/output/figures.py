"""Writes an evaluation's figures, with captions, as PNG and PDF reproducible byte for byte."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from jaxpf.evaluation.equal_time import curves
from jaxpf.evaluation.output import charts
from jaxpf.evaluation.output.tables import Tables
from jaxpf.evaluation.results import Results
from jaxpf.files.writing import atomic_write, report_os_errors

_STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # names may contain dollar signs
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,  # embed TrueType fonts, which publishers require
}


class Figure(NamedTuple):
    """A saved figure.

    Attributes:
        name: of the files, without suffix.
        title: of the figure.
        caption: how to read it and how its intervals are computed.
        png: path of the PNG file.
    """

    name: str
    title: str
    caption: str
    png: Path


class _Plan(NamedTuple):
    name: str
    title: str
    caption: str
    draw: Callable[[], Any]


def write_figures(results: Results, tables: Tables) -> list[Figure]:
    """Write all figures into the folder ``figures`` of the evaluation.

    Raises:
        InputError: a file cannot be written.
    """
    folder = results.folder / "figures"
    with report_os_errors("create the folder", folder):
        folder.mkdir(exist_ok=True)
    if not tables.summaries:
        return []
    written = []
    with in_style():
        for plan in _plans(results, tables):
            path = folder / f"{plan.name}.png"
            save(plan.draw(), path)
            written.append(Figure(plan.name, plan.title, plan.caption, path))
    return written


def in_style() -> Any:
    """Context manager with the style for drawing and saving figures."""
    from matplotlib import rc_context

    return rc_context(_STYLE)


def save(figure: Any, png: str | os.PathLike[str]) -> None:
    """Write ``png`` and a PDF next to it, both without a creation date."""
    # Lay out once for both files, because the layout is slow.
    figure.draw_without_rendering()
    figure.set_layout_engine(None)
    with atomic_write(png, "wb") as file:
        figure.savefig(file, dpi=130, format="png", metadata={"Software": None})
    metadata = {"CreationDate": None, "Creator": None, "Producer": None}
    with atomic_write(Path(png).with_suffix(".pdf"), "wb") as file:
        figure.savefig(file, format="pdf", metadata=metadata)


def _plans(results: Results, tables: Tables) -> list[_Plan]:
    """The figures that these results allow; curves show the best configurations only."""
    summaries, ids = tables.summaries, results.object_ids
    best = tables.best_first(charts.MOST_LINES)
    calibrated = [summary for summary in best if summary.transforms.any()]
    confident = [summary for summary in best if summary.confidence.frames[-1]]
    of_many = f" Of {len(ids)} objects, those recovered least."
    shown = f" The best {len(best)} of {len(summaries)} configurations."
    shown = shown if len(best) < len(summaries) else ""
    plans = [
        _Plan(
            "overlaps",
            "Success",
            "Dots: share of the frames whose overlap with the truth exceeds .5, and the mean of "
            "that share over all thresholds (wu2013). Bars: 95 % intervals over runs."
            + (of_many if len(ids) > charts.MOST_OBJECTS else ""),
            lambda: charts.overlaps(ids, summaries),
        ),
        _Plan(
            "success-curves",
            "Success curves",
            "Share of the frames whose overlap with the truth exceeds a threshold (wu2013), "
            "without the start frame. Bands: 95 % normal intervals over runs. In brackets: the "
            "area under the curve." + shown,
            lambda: charts.success_curves(best),
        ),
        _Plan(
            "error-over-time",
            "Centre error over time",
            "Line: median over runs and objects. Dark band: the middle half. Pale band: from 5 to "
            "95 %. These are quantiles, not intervals; frames without truth or estimate do not "
            "count." + shown,
            lambda: charts.error_over_time(results.start_frame + 1, best),
        ),
    ]
    if calibrated:
        plans.append(
            _Plan(
                "calibration",
                "Calibration",
                "How often the central region of a given probability holds the truth: x and y of "
                "all objects, in frames in which the object is followed. On the dotted line "
                "spreads are honest, below it they are too narrow." + shown,
                lambda: charts.calibration(calibrated),
            )
        )
    if confident:
        plans.append(
            _Plan(
                "confidence",
                "Reliability of confidence",
                "Share of the boxes on their object, in five bins of confidence. On the dotted "
                "line confidence is honest, below it too high. Bars: 95 % intervals over runs."
                + shown,
                lambda: charts.confidence(confident),
            )
        )
    if curves(summaries):
        plans.append(
            _Plan(
                "against-time",
                "Accuracy against time",
                "Lines join numbers of particles. Time: of one run alone on this machine, from a "
                "frame in memory to its estimate. Bars: 95 % intervals over runs. Of two "
                "methods, the higher on the left, or the lower on the right, is better at equal "
                "time.",
                lambda: charts.against_time(summaries, len(ids)),
            )
        )
    return plans
