"""Writes an evaluation's figures, with captions, as PNG and PDF reproducible byte for byte."""

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.evaluation.equal_time import curves
from jaxpf.evaluation.output import charts
from jaxpf.evaluation.output.layout import object_name
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
            figure = plan.draw()
            path = folder / f"{plan.name}.png"
            save(figure, path)
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
    summaries, ids = tables.summaries, results.object_ids
    hardest = object_name(ids, tables.hardest)
    several = len(ids) > 1
    # The most informative objects: all together, and the one with the lowest recovery.
    places = [len(ids), tables.hardest] if several else [0]
    of_many = f" Of {len(ids)} objects, those recovered least."
    of_many = of_many if len(ids) > charts.MOST_OBJECTS else ""
    plans = [
        _Plan(
            "overlaps",
            "Success at an overlap of .5, and the area under the success curve",
            "Dots: share of the frames whose overlap with the truth exceeds .5, and the mean of "
            "that share over all thresholds (wu2013). Bars: 95 % intervals over runs." + of_many,
            lambda: charts.overlaps(results, tables),
        ),
        _Plan(
            "rates",
            "Success and recovery of smith2004",
            "Dots: share of the runs; a shared pixel is enough. Bars: 95 % intervals; Wilson's for "
            "one object, and for all objects at the effective number of trials, because objects of "
            "a run are alike." + of_many,
            lambda: charts.rates(results, tables),
        ),
    ]
    if any(summary.reference is not None for summary in summaries):
        plans.append(
            _Plan(
                "differences",
                "Paired differences",
                "Each method less the first one of equal parameters, on common seeds; that one "
                "itself, where parameters vary, less its first setting. Bars: 95 % "
                "intervals of the difference, not corrected for the number of comparisons. Where a "
                "bar crosses the line at 0, these runs do not distinguish the two.",
                lambda: charts.differences(results, tables, places),
            )
        )
    filters = [s for s in summaries if np.isfinite(s.estimates["uniqueness"].value).any()]
    if filters:
        plans.append(
            _Plan(
                "diversity",
                "Uniqueness and effective dynamics per object",
                "As figures 4 and 8 of smith2004. Uniqueness: distinct draws over particles. "
                "Effective dynamics: standard deviation of the particle set over that of the "
                "process noise; it may exceed 100 %. Means over frames and runs"
                + (", with 95 % intervals over runs." if len(filters) < charts.MANY else "."),
                lambda: charts.diversity(ids, filters),
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
    if any(summary.transforms.any() for summary in summaries):
        plans.append(
            _Plan(
                "calibration",
                "Calibration",
                "Left: how often the central region of a given probability holds the truth, x and "
                "y of all objects together, in frames in which the object is followed; on the "
                "dotted line spreads are honest, below it they are too narrow. Right: probability "
                "integral transforms, level if spreads are honest, heaped at the ends if too "
                "narrow.",
                lambda: charts.calibration(summaries),
            )
        )
    over = "runs and objects" if several else "runs"
    for place in places:
        which = object_name(ids, place)
        single = place != len(ids)
        plans.append(
            _Plan(
                f"error-over-time-{'all' if not single else f'object-{ids[place]}'}",
                f"Centre error over time: {which}",
                f"Line: median over {'runs' if single else over}. Dark band: the middle half. Pale "
                "band: from 5 to 95 %. These are quantiles, not intervals; frames without truth "
                "or estimate do not count."
                + (f" Of all objects, {hardest} was recovered least." * (single and several)),
                functools.partial(charts.error_over_time, results, summaries, place),
            )
        )
    plans.append(
        _Plan(
            "success-curves",
            "Success curves",
            "Share of the frames whose overlap with the truth exceeds a threshold (wu2013), the "
            "start frame left out. "
            + (
                "Bands: 95 % normal intervals over runs. In brackets: the area under the curve."
                if len(summaries) <= charts.MOST_LINES
                else "One line per configuration, one colour per method. In brackets: the areas "
                "under the curves."
            ),
            lambda: charts.success_curves(results, summaries, places),
        )
    )
    return plans
